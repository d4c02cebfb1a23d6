// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// What columns are multiplied with: `factors` numbers a column and pose (3 where a column is a
// scalar field that moves vertices along x, y and z, 1 where it holds coordinates). #columns by
// factors * #poses, those of a pose side by side.
struct ColumnWeights {
  int factors = 1;
  Eigen::MatrixXd typical;  // what the columns are turned for
  Eigen::MatrixXd widest;   // what they must answer within the tolerance
};

// Lower L with L L^T the uses' covariance: typical uses are white in L^-1 f. What no typical use
// needs counts for a thousandth of its widest use: so that the turning can be undone.
Eigen::MatrixXd UsesRoot(const ColumnWeights& uses);

// Columns that hardly differ, or that poses use together only, said by fewer:
//   columns * f = kept * (map * f) + cut * (cut_map * f)   for every f, to rounding,
// where [kept cut] are the columns turned to their principal axes under the weight of their uses
// (the covariance of typical f: Cholesky, then the eigenvectors of the weighted Gram matrix). The
// second term is left out; CutErrorMm says what that can put off.
class ColumnCompression {
 public:
  // As few columns as keep the cut part of the widest uses below `tolerance_mm`. `columns`: #rows
  // by #columns in mm, of which `rows_per_vertex` (1 or 3) rows in turn belong to one vertex.
  ColumnCompression(const Eigen::MatrixXd& columns, int rows_per_vertex, const ColumnWeights& uses,
                    double tolerance_mm);

  // #rows by #kept, those that matter least first.
  const Eigen::MatrixXd& kept() const { return kept_; }
  // Of every kept one: the largest displacement that it gives a vertex, a unit of its factors.
  const Eigen::VectorXd& gains() const { return gains_; }

  // Writes what becomes of factors: map, gains, cut_map and tail.
  void Describe(PortableAnswers* answers) const;

  Eigen::Index num_kept() const { return map_.rows(); }
  // At most, while it is made and later.
  static int64_t BytesNeeded(Eigen::Index rows, Eigen::Index columns);

 private:
  Eigen::MatrixXd kept_;
  Eigen::VectorXd gains_;
  Eigen::MatrixXd map_;
  // Bounds need few digits. Rows are the cut columns', times the largest displacement that each
  // gives a vertex; the last ones, which hardly say anything, are summed up into `tail_`: one
  // number a column, the sum of their sizes.
  Eigen::MatrixXf cut_map_;
  Eigen::VectorXf tail_;
};

}  // namespace tissueform
