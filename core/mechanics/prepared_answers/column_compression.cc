// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/column_compression.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace tissueform {
namespace {

// Part of the uses' variance that is added in every direction: what typical poses do not use is
// still said to eight digits, and the turning can be undone.
constexpr double kUnusedVariance = 1e-8;
// Of the tolerance: what the tail's coarser bound may take.
constexpr double kTailOfTolerance = 0.05;
constexpr double kUnitRoundoff = 5.97e-8;  // of singles

// How large the factors of every column are, by their root mean square.
Eigen::VectorXd RowSizes(const Eigen::MatrixXd& uses) {
  const auto count = static_cast<double>(std::max<Eigen::Index>(uses.cols(), 1));
  return uses.rowwise().norm() / std::sqrt(count);
}

// Of every column: the largest displacement that it gives a vertex.
Eigen::VectorXd Gains(const Eigen::MatrixXd& columns, int rows_per_vertex) {
  Eigen::VectorXd gains = Eigen::VectorXd::Zero(columns.cols());
  if (columns.rows() == 0) return gains;
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    gains[c] = std::sqrt(columns.col(c)
                             .reshaped(rows_per_vertex, columns.rows() / rows_per_vertex)
                             .colwise()
                             .squaredNorm()
                             .maxCoeff());
  }
  return gains;
}

// Sizes of the coefficients of every pose, #columns by #poses.
Eigen::MatrixXd Sizes(const Eigen::MatrixXd& coefficients, int factors) {
  const Eigen::Index poses = coefficients.cols() / factors;
  Eigen::MatrixXd sizes(coefficients.rows(), poses);
  for (Eigen::Index s = 0; s < poses; ++s) {
    sizes.col(s) = coefficients.middleCols(factors * s, factors).rowwise().norm();
  }
  return sizes;
}

// How many rows from the end on stay below the limit together for every pose. `moves`: what every
// column moves a vertex by, in descending order of its largest, #columns by #poses.
Eigen::Index CountBelow(const Eigen::MatrixXd& moves, double limit) {
  Eigen::RowVectorXd sums = Eigen::RowVectorXd::Zero(moves.cols());
  Eigen::Index count = 0;
  while (count < moves.rows()) {
    sums += moves.row(moves.rows() - 1 - count);
    if (moves.cols() > 0 && sums.maxCoeff() > limit) break;
    ++count;
  }
  return count;
}

}  // namespace

Eigen::MatrixXd UsesRoot(const ColumnWeights& uses) {
  constexpr double kOfWidest = 1e-3;
  const Eigen::MatrixXd& typical = uses.typical;
  const Eigen::Index columns = typical.rows();
  Eigen::VectorXd sizes = RowSizes(typical).cwiseMax(kOfWidest * RowSizes(uses.widest));
  sizes = (sizes.array() > 0).select(sizes, 1.0);
  const Eigen::MatrixXd scaled = sizes.cwiseInverse().asDiagonal() * typical;
  Eigen::MatrixXd covariance = kUnusedVariance * Eigen::MatrixXd::Identity(columns, columns);
  covariance.selfadjointView<Eigen::Lower>().rankUpdate(
      scaled, 1.0 / static_cast<double>(std::max<Eigen::Index>(typical.cols(), 1)));
  const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance);
  return sizes.asDiagonal() * Eigen::MatrixXd(cholesky.matrixL());
}

ColumnCompression::ColumnCompression(const Eigen::MatrixXd& columns, int rows_per_vertex,
                                     const ColumnWeights& uses, double tolerance_mm) {
  const Eigen::Index count = columns.cols();
  const Eigen::MatrixXd root = UsesRoot(uses);
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(count, count);
  if (columns.rows() > 0) gram.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
  gram = root.transpose() * gram.selfadjointView<Eigen::Lower>() * root;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(gram);

  // All of them: small eigenvalues are rounding, so what a cut column does is measured.
  const Eigen::MatrixXd turned = columns * (root * axes.eigenvectors());
  const Eigen::MatrixXd undo =
      axes.eigenvectors().transpose() *
      root.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(count, count));
  const Eigen::VectorXd gains = Gains(turned, rows_per_vertex);
  const Eigen::MatrixXd moves = gains.asDiagonal() * Sizes(undo * uses.widest, uses.factors);
  const Eigen::VectorXd largest =
      moves.cols() > 0 ? Eigen::VectorXd(moves.rowwise().maxCoeff()) : gains;
  std::vector<Eigen::Index> order(static_cast<size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&largest](Eigen::Index a, Eigen::Index b) { return largest[a] > largest[b]; });

  const Eigen::Index kept = count - CountBelow(moves(order, Eigen::all), tolerance_mm);
  std::vector<Eigen::Index> kept_ones(order.begin(), order.begin() + kept);
  std::reverse(kept_ones.begin(), kept_ones.end());
  kept_ = turned(Eigen::all, kept_ones);
  gains_ = gains(kept_ones);
  map_ = undo(kept_ones, Eigen::all);

  const std::vector<Eigen::Index> cut_ones(order.begin() + kept, order.end());
  const Eigen::MatrixXd cut = gains(cut_ones).asDiagonal() * undo(cut_ones, Eigen::all);
  // What the tail can do at most, pose for pose, when the sizes of its entries are added up.
  const Eigen::MatrixXd used = Sizes(uses.widest, uses.factors);
  Eigen::VectorXd tail = Eigen::VectorXd::Zero(count);
  Eigen::Index first_of_tail = cut.rows();
  while (first_of_tail > 0 && used.cols() > 0) {
    const Eigen::VectorXd longer = tail + cut.row(first_of_tail - 1).transpose().cwiseAbs();
    if ((longer.transpose() * used).maxCoeff() > kTailOfTolerance * tolerance_mm) break;
    tail = longer;
    --first_of_tail;
  }
  const Eigen::MatrixXd summed_up_alone = cut.topRows(first_of_tail);
  // Where terms of the product cancel its rounding may be more than what is left.
  tail += kUnitRoundoff * static_cast<double>(count + 2) *
          summed_up_alone.cwiseAbs().colwise().sum().transpose();
  cut_map_ = summed_up_alone.cast<float>();
  tail_ = tail.cast<float>();
}

void ColumnCompression::Describe(PortableAnswers* answers) const {
  answers->map.assign(map_.data(), map_.data() + map_.size());
  answers->gains.assign(gains_.begin(), gains_.end());
  answers->cut_map.assign(cut_map_.data(), cut_map_.data() + cut_map_.size());
  answers->tail.assign(tail_.begin(), tail_.end());
}

int64_t ColumnCompression::BytesNeeded(Eigen::Index rows, Eigen::Index columns) {
  // Turned columns and the kept ones of them; some matrices of #columns by #columns.
  constexpr int64_t kSquares = 8;
  return (2 * rows + kSquares * columns) * columns * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
