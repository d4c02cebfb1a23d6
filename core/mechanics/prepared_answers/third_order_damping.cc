// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/third_order_damping.h"

#include <cmath>

#include <Eigen/Eigenvalues>

#include "core/mechanics/prepared_answers/small_product.h"

namespace tissueform {
namespace {

// Rows whose products are as long as the root mean square of the columns', by the eigenvectors of
// the columns' own products. Columns of turns are thousands of times as long as those of moves, so
// each is brought to length one first, or small ones would be lost.
Eigen::MatrixXf LengthsOf(const Eigen::MatrixXd& columns) {
  constexpr double kNegligible = 1e-13;  // of the largest eigenvalue: what rounding leaves
  const Eigen::Index count = columns.cols();
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(count, count);
  products.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose(),
                                                      3.0 / static_cast<double>(columns.rows()));
  const Eigen::VectorXd sizes = products.diagonal().cwiseSqrt();
  const Eigen::VectorXd undo = sizes.unaryExpr([](double s) { return s > 0 ? 1 / s : 0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(undo.asDiagonal() * products *
                                                            undo.asDiagonal());
  const Eigen::VectorXd& values = axes.eigenvalues();  // rising
  Eigen::Index first = 0;
  while (first + 1 < count && values[first] <= kNegligible * values[count - 1]) ++first;
  const Eigen::Index kept = count - first;
  const Eigen::VectorXd roots = values.tail(kept).cwiseMax(0).cwiseSqrt();
  const Eigen::MatrixXd rows =
      roots.asDiagonal() * axes.eigenvectors().rightCols(kept).transpose() * sizes.asDiagonal();
  return rows.cast<float>();
}

double LengthOf(const Eigen::MatrixXf& lengths, const Eigen::VectorXd& products) {
  const RowMajorMatrix<float> factors = products.cast<float>();
  return MultiplySmall(lengths, factors).cast<double>().norm();
}

void DescribeRows(const Eigen::MatrixXf& lengths, std::vector<float>* rows) {
  const RowMajorMatrix<float> by_row = lengths;
  rows->assign(by_row.data(), by_row.data() + by_row.size());
}

}  // namespace

ThirdOrderDamping::ThirdOrderDamping(const Eigen::MatrixXd& second, const Eigen::MatrixXd& third)
    : second_lengths_(LengthsOf(second)), third_lengths_(LengthsOf(third)) {}

double ThirdOrderDamping::Ratio(const Eigen::VectorXd& pairs,
                                const Eigen::VectorXd& triples) const {
  const double second = LengthOf(second_lengths_, pairs);
  return second > 0 ? LengthOf(third_lengths_, triples) / second : 0;
}

void ThirdOrderDamping::Describe(PortableAnswers* answers) const {
  DescribeRows(second_lengths_, &answers->second_lengths);
  DescribeRows(third_lengths_, &answers->third_lengths);
}

int64_t ThirdOrderDamping::bytes_held() const {
  return (second_lengths_.size() + third_lengths_.size()) * static_cast<int64_t>(sizeof(float));
}

}  // namespace tissueform
