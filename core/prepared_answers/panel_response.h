// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "core/base/types.h"
#include "core/prepared_answers/panel_matrix.h"
#include "core/prepared_answers/vertex_response.h"

namespace tissueform {

// Rest positions of chosen vertices and prepared displacement columns, in single precision: what
// answers linear in their columns are made of. Displacements are added up in the order of the
// columns, rest comes last, so digits are not lost to the coordinates' own size. Small columns
// should come first.
class PanelResponse {
 public:
  // What a row of a column is: a vertex, whose three coordinates come from three factors, or one
  // coordinate of a vertex (3 v + axis), all from one factor.
  enum class Rows { kVertices, kCoordinates };

  PanelResponse(const Positions& rest, Rows rows, Eigen::Index columns);

  // `values` has a number for every row.
  void SetColumn(Eigen::Index column, const Eigen::Ref<const Eigen::VectorXd>& values);

  // How much is read of the columns.
  struct Reading {
    Eigen::Index first_column = 0;  // those before it say less than matters
    PanelMatrix::Digits digits = PanelMatrix::Digits::kAll;
    // How far, in mm, a vertex can be put off: by what is not read, and by rounding. A bound, not
    // an estimate: every stored entry, factor, product and partial sum is counted with half a unit
    // in the last place of the largest value that it can take.
    double bound_mm = 0;
  };

  // The least that keeps the bound within the tolerance, or all: a frame takes the time that its
  // reading does. `factors` has as many rows as there are columns, and 3 columns for kVertices, 1
  // for kCoordinates.
  Reading Choose(const Eigen::MatrixXd& factors, double tolerance_mm) const;

  // rest + columns * factors.
  void Evaluate(const Eigen::MatrixXd& factors, const Reading& reading,
                FloatPositions* positions) const;

  Eigen::Index num_vertices() const { return rest_.rows(); }
  Eigen::Index num_columns() const { return panels_.cols(); }
  int64_t bytes_held() const { return BytesNeeded(num_vertices(), rows_, num_columns()); }
  static int64_t BytesNeeded(Eigen::Index num_vertices, Rows rows, Eigen::Index columns);

 private:
  double RoundingBoundMm(const Eigen::VectorXd& sizes) const;

  FloatPositions rest_;
  Rows rows_;
  double largest_rest_;  // distance of a vertex from zero
  PanelMatrix panels_;
  Eigen::VectorXd largest_;  // of every column: largest entry, or displacement for kCoordinates
};

}  // namespace tissueform
