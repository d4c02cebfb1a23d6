// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/panel_response.h"

#include <cmath>

namespace tissueform {
namespace {

Eigen::Index NumRows(Eigen::Index num_vertices, PanelResponse::Rows rows) {
  return rows == PanelResponse::Rows::kVertices ? num_vertices : 3 * num_vertices;
}

}  // namespace

PanelResponse::PanelResponse(const Positions& rest, Rows rows, Eigen::Index columns)
    : rest_(rest.cast<float>()),
      rows_(rows),
      largest_rest_(rest.rows() > 0 ? rest.rowwise().norm().maxCoeff() : 0),
      panels_(NumRows(rest.rows(), rows), columns),
      largest_(Eigen::VectorXd::Zero(columns)) {}

void PanelResponse::SetColumn(Eigen::Index column,
                              const Eigen::Ref<const Eigen::VectorXd>& values) {
  panels_.SetColumn(column, values);
  if (values.size() == 0) {
    return;
  }
  largest_[column] = rows_ == Rows::kVertices
                         ? values.cwiseAbs().maxCoeff()
                         : values.reshaped(3, values.size() / 3).colwise().norm().maxCoeff();
}

PanelResponse::Reading PanelResponse::Choose(const Eigen::MatrixXd& factors,
                                             double tolerance_mm) const {
  const Eigen::VectorXd sizes = factors.rowwise().norm();
  Reading all;
  all.bound_mm = RoundingBoundMm(sizes);
  // What a column is left out for is no more than a small part of the tolerance: most of a small
  // pose's high degrees.
  constexpr double kLeftOutOfTolerance = 0.25;
  Reading less;
  less.digits = PanelMatrix::Digits::kUpperHalf;
  double left_out = 0;
  while (less.first_column < sizes.size()) {
    const double more = sizes[less.first_column] * largest_[less.first_column];
    if (left_out + more > kLeftOutOfTolerance * tolerance_mm) break;
    left_out += more;
    ++less.first_column;
  }
  // Half a step in every coordinate, which three factors turn together.
  const double per_step = rows_ == Rows::kVertices ? 0.5 : 0.5 * std::sqrt(3.0);
  less.bound_mm = all.bound_mm + left_out;
  for (Eigen::Index c = less.first_column; c < sizes.size(); ++c) {
    less.bound_mm += per_step * sizes[c] * panels_.upper_step(c);
  }
  return less.bound_mm <= tolerance_mm ? less : all;
}

void PanelResponse::Evaluate(const Eigen::MatrixXd& factors, const Reading& reading,
                             FloatPositions* positions) const {
  positions->resize(rest_.rows(), 3);
  panels_.Multiply(factors, reading.first_column, reading.digits, positions->data());
  *positions += rest_;
}

double PanelResponse::RoundingBoundMm(const Eigen::VectorXd& sizes) const {
  constexpr double kHalfUnit = 5.98e-8;  // 2^-24 and a little for terms of second order
  double sum = 0;
  double partial_sums = 0;
  for (Eigen::Index c = 0; c < sizes.size(); ++c) {
    sum += sizes[c] * largest_[c];
    // Columns are added in their order and small ones come first, so the early partial sums, which
    // every later rounding is measured by, stay small.
    partial_sums += sum;
  }
  // Entry, factor and product of every column, every partial sum; the rest, the result.
  return kHalfUnit * (3 * sum + partial_sums + largest_rest_ + largest_rest_ + sum);
}

int64_t PanelResponse::BytesNeeded(Eigen::Index num_vertices, Rows rows, Eigen::Index columns) {
  return PanelMatrix::BytesNeeded(NumRows(num_vertices, rows), columns) +
         3 * num_vertices * static_cast<int64_t>(sizeof(float)) +
         columns * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
