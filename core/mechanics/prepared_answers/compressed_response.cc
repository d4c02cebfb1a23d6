// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/compressed_response.h"

#include <algorithm>
#include <cmath>

namespace tissueform {
namespace {

using Rows = CompressedResponse::Rows;

// Parts of the tolerance: what is cut for good; what a frame leaves out of its small columns, where
// the digits of the others allow it; what all may take of uses that were tried, so that there is
// room for those that were not.
constexpr double kCutOfTolerance = 0.25;
constexpr double kLeftOutOfTolerance = 0.2;
constexpr double kTriedOfTolerance = 0.85;

Eigen::Index NumRows(Eigen::Index num_vertices, Rows rows) {
  return rows == Rows::kVertices ? num_vertices : 3 * num_vertices;
}

int RowsPerVertex(Rows rows) { return rows == Rows::kVertices ? 1 : 3; }

}  // namespace

Eigen::MatrixXd RowsOfVertices(const Eigen::MatrixXd& columns,
                               const std::vector<int32_t>& vertices) {
  Eigen::MatrixXd rows(3 * static_cast<Eigen::Index>(vertices.size()), columns.cols());
  for (size_t i = 0; i < vertices.size(); ++i) {
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(i)) =
        columns.middleRows<3>(3 * Eigen::Index{vertices[i]});
  }
  return rows;
}

CompressedResponse::CompressedResponse(const Positions& rest, Rows rows,
                                       const Eigen::MatrixXd& columns, const ColumnWeights& uses,
                                       double tolerance_mm)
    : rest_(rest.cast<float>()),
      rows_(rows),
      largest_rest_(rest.rows() > 0 ? rest.rowwise().norm().maxCoeff() : 0),
      compression_(columns, RowsPerVertex(rows), uses, kCutOfTolerance * tolerance_mm),
      panels_(NumRows(rest.rows(), rows), compression_.num_kept(),
              CountFullColumns(uses, tolerance_mm)) {
  for (Eigen::Index c = 0; c < panels_.cols(); ++c) {
    panels_.SetColumn(c, compression_.kept().col(c));
  }
  compression_.ReleaseKept();
}

// Before the panels are there: steps come from the columns themselves.
Eigen::Index CompressedResponse::CountFullColumns(const ColumnWeights& uses,
                                                  double tolerance_mm) const {
  const Eigen::MatrixXd& kept = compression_.kept();
  Eigen::VectorXd errors(kept.cols());
  for (Eigen::Index c = 0; c < kept.cols(); ++c) {
    const double largest = kept.rows() > 0 ? kept.col(c).cwiseAbs().maxCoeff() : 0;
    errors[c] = UpperHalfErrorMm(QuantizedMatrix::UpperStepOf(largest));
  }
  Eigen::Index full = 0;
  for (Eigen::Index first = 0; first < uses.widest.cols(); first += uses.factors) {
    const Eigen::MatrixXd factors = uses.widest.middleCols(first, uses.factors);
    const Eigen::VectorXd sizes = compression_.Map(factors).rowwise().norm();
    const double room = kTriedOfTolerance * tolerance_mm - compression_.CutBoundMm(factors) -
                        RoundingBoundMm(sizes);
    double error = errors.dot(sizes);
    for (Eigen::Index c = 1; c <= full; ++c)
      error -= errors[kept.cols() - c] * sizes[kept.cols() - c];
    while (error > room && full < kept.cols()) {
      ++full;
      error -= errors[kept.cols() - full] * sizes[kept.cols() - full];
    }
  }
  return full;
}

double CompressedResponse::UpperHalfErrorMm(double upper_step) const {
  // Half a step in every coordinate, which three factors turn together.
  return (rows_ == Rows::kVertices ? 0.5 : 0.5 * std::sqrt(3.0)) * upper_step;
}

CompressedResponse::EvaluationPlan CompressedResponse::Choose(const Eigen::MatrixXd& factors,
                                                              double tolerance_mm) const {
  EvaluationPlan reading;
  reading.factors = compression_.Map(factors);
  const Eigen::VectorXd sizes = reading.factors.rowwise().norm();
  const double of_all = compression_.CutBoundMm(factors) + RoundingBoundMm(sizes);
  QuantizedMatrix::EvaluationPlan& columns = reading.columns;
  double left_out = 0;
  while (columns.first < sizes.size()) {
    const double more = sizes[columns.first] * compression_.gains()[columns.first];
    if (left_out + more > kLeftOutOfTolerance * tolerance_mm) break;
    left_out += more;
    ++columns.first;
  }
  // From the most important one on columns are read to their last digit until it is enough.
  const Eigen::Index only_upper = panels_.cols() - panels_.full_cols();
  double of_digits = 0;
  for (Eigen::Index c = columns.first; c < sizes.size(); ++c) {
    of_digits += UpperHalfErrorMm(panels_.upper_step(c)) * sizes[c];
  }
  columns.first_full = panels_.cols();
  while (of_all + left_out + of_digits > tolerance_mm &&
         columns.first_full > std::max(only_upper, columns.first)) {
    --columns.first_full;
    of_digits -=
        UpperHalfErrorMm(panels_.upper_step(columns.first_full)) * sizes[columns.first_full];
  }
  reading.bound_mm = of_all + left_out + std::max(of_digits, 0.0);
  if (reading.bound_mm > tolerance_mm) {
    // All that there is: whoever asks all the same gets the best answer.
    columns = {.first = 0, .first_full = only_upper};
    reading.bound_mm = of_all;
    for (Eigen::Index c = 0; c < only_upper; ++c) {
      reading.bound_mm += UpperHalfErrorMm(panels_.upper_step(c)) * sizes[c];
    }
  }
  return reading;
}

void CompressedResponse::Evaluate(const EvaluationPlan& reading, FloatPositions* positions) const {
  if (positions->rows() < rest_.rows()) positions->resize(rest_.rows(), 3);
  panels_.Multiply(reading.factors, reading.columns, positions->data());
  positions->topRows(rest_.rows()) += rest_;
}

double CompressedResponse::RoundingBoundMm(const Eigen::VectorXd& sizes) const {
  constexpr double kHalfUnit = 5.98e-8;  // 2^-24 and a little for terms of second order
  double sum = 0;
  double partial_sums = 0;
  for (Eigen::Index c = 0; c < sizes.size(); ++c) {
    sum += sizes[c] * compression_.gains()[c];
    // Columns are added in their order and small ones come first, so the early partial sums, which
    // every later rounding is measured by, stay small.
    partial_sums += sum;
  }
  // Entry, factor and product of every column, every partial sum; the rest, the result.
  return kHalfUnit * (3 * sum + partial_sums + largest_rest_ + largest_rest_ + sum);
}

void CompressedResponse::Describe(PortableAnswers* answers) const {
  answers->free_rest.assign(rest_.data(), rest_.data() + rest_.size());
  answers->numbers.largest_rest_mm = largest_rest_;
  compression_.Describe(answers);
  panels_.Describe(&answers->columns);
}

int64_t CompressedResponse::bytes_held() const {
  return panels_.bytes_held() + compression_.bytes_held() +
         rest_.size() * static_cast<int64_t>(sizeof(float));
}

int64_t CompressedResponse::BytesNeeded(Eigen::Index num_vertices, Rows rows,
                                        Eigen::Index columns) {
  const Eigen::Index num_rows = NumRows(num_vertices, rows);
  return QuantizedMatrix::BytesNeeded(num_rows, columns, columns) +
         ColumnCompression::BytesNeeded(num_rows, columns) +
         3 * num_vertices * static_cast<int64_t>(sizeof(float)) +
         // The columns that it is made of.
         num_rows * columns * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
