// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/third_order_lengths.h"

#include <Eigen/Eigenvalues>

namespace tissueform {

// By the eigenvectors of the columns' own products. Columns of turns are thousands of times as long
// as those of moves, so each is brought to length one first, or small ones would be lost.
std::vector<float> LengthsOf(const Eigen::MatrixXd& columns) {
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
  const Eigen::MatrixXf singles = rows.cast<float>();
  return {singles.data(), singles.data() + singles.size()};
}

}  // namespace tissueform
