// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/panel_response.h"

#include <utility>

namespace tissueform {
namespace {

Eigen::Index NumRows(Eigen::Index num_vertices, PanelResponse::Rows rows) {
  return rows == PanelResponse::Rows::kVertices ? num_vertices : 3 * num_vertices;
}

}  // namespace

PanelResponse::PanelResponse(Positions rest, Rows rows, Eigen::Index columns)
    : rest_(std::move(rest)),
      rows_(rows),
      largest_rest_(rest_.rows() > 0 ? rest_.rowwise().norm().maxCoeff() : 0),
      panels_(NumRows(rest_.rows(), rows), columns),
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

void PanelResponse::Evaluate(const Eigen::MatrixXd& factors, FloatPositions* positions) const {
  positions->resize(rest_.rows(), 3);
  panels_.Multiply(factors.cast<float>(), positions->data());
  *positions = (rest_ + positions->cast<double>()).cast<float>();
}

double PanelResponse::RoundingBoundMm(const Eigen::MatrixXd& factors) const {
  constexpr double kHalfUnit = 5.97e-8;  // 2^-24 and a little for terms of second order
  double sum = 0;
  double partial_sums = 0;
  for (Eigen::Index c = 0; c < factors.rows(); ++c) {
    sum += factors.row(c).norm() * largest_[c];
    // Columns are added in their order and small ones come first, so the early partial sums, which
    // every later rounding is measured by, stay small.
    partial_sums += sum;
  }
  // Entry, factor and product of every column, every partial sum, the result.
  return kHalfUnit * (3 * sum + partial_sums + largest_rest_ + sum);
}

int64_t PanelResponse::BytesNeeded(Eigen::Index num_vertices, Rows rows, Eigen::Index columns) {
  return PanelMatrix::BytesNeeded(NumRows(num_vertices, rows), columns) +
         (3 * num_vertices + columns) * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
