// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/prepared_answers/column_compression.h"
#include "core/mechanics/prepared_answers/quantized_matrix.h"

namespace tissueform {

// Of columns with three rows a vertex (3 v + axis) those of the chosen vertices, in their order.
Eigen::MatrixXd RowsOfVertices(const Eigen::MatrixXd& columns,
                               const std::vector<int32_t>& vertices);

// Rest positions of chosen vertices and prepared displacement columns, compressed, in single
// precision: what answers linear in their columns are made of. Displacements are added up in the
// order of the columns, those first that matter least, and rest comes last, so digits are not lost
// to the coordinates' own size.
class CompressedResponse {
 public:
  // What a row of a column is: a vertex, whose three coordinates come from three factors, or one
  // coordinate of a vertex (3 v + axis), all from one factor.
  enum class Rows { kVertices, kCoordinates };

  // `columns`: a number for every row, mm; `uses` as ColumnWeights says, whose widest are answered
  // within `tolerance_mm` where single precision is enough for that.
  CompressedResponse(const Positions& rest, Rows rows, const Eigen::MatrixXd& columns,
                     const ColumnWeights& uses, double tolerance_mm);

  // What is read of the columns, and what it is multiplied with.
  struct EvaluationPlan {
    Eigen::MatrixXd factors;  // of the compressed columns
    QuantizedMatrix::EvaluationPlan columns;
    // How far, in mm, a vertex can be put off: by what was cut, by what is not read, and by
    // rounding. A bound, not an estimate: every stored entry, factor, product and partial sum is
    // counted with half a unit in the last place of the largest value that it can take.
    double bound_mm = 0;
  };

  // The least that keeps the bound within the tolerance, or all: a frame takes the time that its
  // reading does. `factors` has as many rows as there were columns, and 3 columns for kVertices, 1
  // for kCoordinates.
  EvaluationPlan Choose(const Eigen::MatrixXd& factors, double tolerance_mm) const;

  // rest + columns * factors, in the first num_vertices() rows; resized where there are fewer.
  void Evaluate(const EvaluationPlan& reading, FloatPositions* positions) const;

  // Writes the vertices' rest as that of the free ones, columns and their compression.
  void Describe(PortableAnswers* answers) const;

  Eigen::Index num_vertices() const { return rest_.rows(); }
  Eigen::Index num_columns() const { return panels_.cols(); }
  Eigen::Index num_columns_before() const { return compression_.num_columns(); }
  int64_t bytes_held() const;
  // At most, while it is made and later.
  static int64_t BytesNeeded(Eigen::Index num_vertices, Rows rows, Eigen::Index columns);

 private:
  // From compressed factors, of all that is held.
  double RoundingBoundMm(const Eigen::VectorXd& sizes) const;
  // What a column whose upper half alone is read puts a vertex off by, a unit of its factors.
  double UpperHalfErrorMm(double upper_step) const;
  Eigen::Index CountFullColumns(const ColumnWeights& uses, double tolerance_mm) const;

  FloatPositions rest_;
  Rows rows_;
  double largest_rest_;  // distance of a vertex from zero
  ColumnCompression compression_;
  QuantizedMatrix panels_;
};

}  // namespace tissueform
