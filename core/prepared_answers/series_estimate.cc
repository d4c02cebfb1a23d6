// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/series_estimate.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>
#include <vector>

namespace tissueform {
namespace {

// Products with more would take as long as what they estimate.
constexpr size_t kProbes = 64;

// The vertex that a column moves most, and how far.
std::pair<Eigen::Index, double> LargestMove(const Eigen::Ref<const Eigen::VectorXd>& column) {
  Eigen::Index vertex = 0;
  if (column.size() == 0) return {vertex, 0};
  const double square =
      column.reshaped(3, column.size() / 3).colwise().squaredNorm().maxCoeff(&vertex);
  return {vertex, std::sqrt(square)};
}

Eigen::VectorXd Gains(const Eigen::MatrixXd& columns) {
  Eigen::VectorXd gains(columns.cols());
  for (Eigen::Index c = 0; c < columns.cols(); ++c) gains[c] = LargestMove(columns.col(c)).second;
  return gains;
}

// Those that single columns move most, by how much of any.
std::vector<Eigen::Index> MostMoved(const Eigen::MatrixXd& columns) {
  if (columns.rows() == 0) return {};
  std::map<Eigen::Index, double> moved;
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const auto [vertex, move] = LargestMove(columns.col(c));
    moved[vertex] = std::max(moved[vertex], move);
  }
  std::vector<std::pair<double, Eigen::Index>> order;
  order.reserve(moved.size());
  for (const auto& [vertex, move] : moved) order.emplace_back(move, vertex);
  std::sort(order.begin(), order.end(), std::greater<>());
  if (order.size() > kProbes) order.resize(kProbes);
  std::vector<Eigen::Index> vertices;
  vertices.reserve(order.size());
  for (const auto& [move, vertex] : order) vertices.push_back(vertex);
  return vertices;
}

}  // namespace

SeriesEstimate::SeriesEstimate(const Eigen::MatrixXd& first, const Eigen::MatrixXd& second,
                               double size_mm)
    : size_mm_(size_mm), first_gains_(Gains(first)), second_gains_(Gains(second)) {
  const std::vector<Eigen::Index> vertices = MostMoved(second);
  probes_.resize(3 * static_cast<Eigen::Index>(vertices.size()), second.cols());
  for (size_t p = 0; p < vertices.size(); ++p) {
    probes_.middleRows<3>(3 * static_cast<Eigen::Index>(p)) =
        second.middleRows<3>(3 * vertices[p]).cast<float>();
  }
}

double SeriesEstimate::UnscaledMm(const Eigen::VectorXd& pairs, std::optional<double> ratio) const {
  if (probes_.rows() == 0) return 0;
  const Eigen::VectorXf moves = probes_ * pairs.cast<float>();
  const double together = LargestMove(moves.cast<double>()).second;
  const double single = second_gains_.cwiseProduct(pairs).norm();
  const double third_order = std::pow(together * single, 0.75) / std::sqrt(size_mm_);
  return ratio ? third_order * *ratio / (1 + *ratio) : third_order;
}

void SeriesEstimate::Describe(PortableAnswers* answers) const {
  answers->numbers.size_mm = size_mm_;
  answers->numbers.estimate_scale = scale_;
  answers->first_gains.assign(first_gains_.begin(), first_gains_.end());
  answers->second_gains.assign(second_gains_.begin(), second_gains_.end());
  const Eigen::MatrixXf rows = probes_.transpose();  // column by column: row-major
  answers->probes.assign(rows.data(), rows.data() + rows.size());
}

int64_t SeriesEstimate::bytes_held() const {
  return probes_.size() * static_cast<int64_t>(sizeof(float)) +
         (first_gains_.size() + second_gains_.size()) * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
