// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"

namespace tissueform {

// Unknowns in which sliding on bone is a prescribed value: at a vertex with bilateral contact rows
// the axes are turned so that the first ones are the rows' normals. Unknowns of all vertices are
// interleaved (3 v + axis), turned or not. Immutable.
//
// Exact: nothing is penalised and no multiplier is solved for, so a bilateral row costs nothing
// when poses come.
class SlidingBasis {
 public:
  explicit SlidingBasis(const ConstraintSet& constraints, Eigen::Index num_vertices);

  // The unknowns along the rows' normals, which are prescribed, and the index of the row of each.
  struct Held {
    int32_t unknown = 0;
    int32_t row = 0;
  };
  const std::vector<Held>& held() const { return held_; }  // by unknown, rising
  bool empty() const { return held_.empty(); }

  struct TurnedVertex {
    int32_t vertex = 0;
    Eigen::Matrix3d axes;  // in its columns
  };
  const std::vector<TurnedVertex>& vertices() const { return vertices_; }  // rising

  // Q^T K Q, where Q x are the unknowns along x, y and z of turned unknowns x. `K` is 3 #V square.
  SparseMatrix Turn(const SparseMatrix& K) const;
  // Q^T x and Q x, 3 #V by k, in place.
  void ToTurned(Eigen::MatrixXd* x) const;
  void FromTurned(Eigen::MatrixXd* x) const;

 private:
  const Eigen::Index num_unknowns_;
  std::vector<TurnedVertex> vertices_;
  std::vector<Held> held_;
};

// Prescribed unknowns inside a matrix that keeps its pattern: `matrix` is K with the rows and
// columns of the held unknowns zero but for the diagonal.
struct HeldMatrix {
  SparseMatrix matrix;
  SparseMatrix columns;      // #rows of K by #held: the columns that were taken out
  Eigen::VectorXd diagonal;  // #held
};

// Of a symmetric K with both triangles stored and a stored diagonal.
HeldMatrix HoldUnknowns(const SparseMatrix& K, const std::vector<SlidingBasis::Held>& held);

// `rhs` (#rows by k) of K x = rhs becomes that of HeldMatrix::matrix where the held unknowns have
// `values` (#held by k).
void PrescribeHeld(const HeldMatrix& held_matrix, const std::vector<SlidingBasis::Held>& held,
                   const Eigen::MatrixXd& values, Eigen::MatrixXd* rhs);

}  // namespace tissueform
