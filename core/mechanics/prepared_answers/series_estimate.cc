// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/series_estimate.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "core/base/percentiles.h"

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
                               const Eigen::MatrixXd& third, double size_mm)
    : size_mm_(size_mm),
      first_gains_(Gains(first)),
      second_gains_(Gains(second)),
      third_gains_(Gains(third)) {
  const std::vector<Eigen::Index> vertices = MostMoved(second);
  probes_.resize(3 * static_cast<Eigen::Index>(vertices.size()), second.cols());
  for (size_t p = 0; p < vertices.size(); ++p) {
    probes_.middleRows<3>(3 * static_cast<Eigen::Index>(p)) =
        second.middleRows<3>(3 * vertices[p]).cast<float>();
  }
}

void SeriesEstimate::Calibrate(const std::vector<Measured>& measured, double allowance) {
  constexpr double kWorstScale = 50;
  std::vector<double> by_second;
  std::vector<double> by_third;
  for (const auto& [terms, error_mm] : measured) {
    const double part = terms.triples.size() > 0 ? terms.ratio / (1 + terms.ratio) : 1;
    const double second = part * BySecondOrder(terms.pairs);
    const double third = part * ByThirdOrder(terms.triples);
    if (second > 0) by_second.push_back(error_mm / second);
    if (third > 0) by_third.push_back(error_mm / third);
  }
  const auto scale = [allowance](std::vector<double> ratios) {
    return allowance * (ratios.empty() ? kWorstScale : Percentile(std::move(ratios), 50));
  };
  second_scale_ = scale(std::move(by_second));
  third_scale_ = scale(std::move(by_third));
}

double SeriesEstimate::Mm(const Terms& terms) const {
  const double second = second_scale_ * BySecondOrder(terms.pairs);
  if (terms.triples.size() == 0) return second;
  return std::max(second, third_scale_ * ByThirdOrder(terms.triples)) * terms.ratio /
         (1 + terms.ratio);
}

double SeriesEstimate::BySecondOrder(const Eigen::VectorXd& pairs) const {
  if (probes_.rows() == 0) return 0;
  const Eigen::VectorXf moves = probes_ * pairs.cast<float>();
  const double together = LargestMove(moves.cast<double>()).second;
  const double single = second_gains_.cwiseProduct(pairs).norm();
  return std::pow(together * single, 0.75) / std::sqrt(size_mm_);
}

void SeriesEstimate::Describe(PortableAnswers* answers) const {
  answers->numbers.size_mm = size_mm_;
  answers->numbers.estimate_scale = second_scale_;
  answers->first_gains.assign(first_gains_.begin(), first_gains_.end());
  answers->second_gains.assign(second_gains_.begin(), second_gains_.end());
  const Eigen::VectorXd third_gains = third_scale_ * third_gains_;
  answers->third_gains.assign(third_gains.begin(), third_gains.end());
  const Eigen::MatrixXf rows = probes_.transpose();  // column by column: row-major
  answers->probes.assign(rows.data(), rows.data() + rows.size());
}

int64_t SeriesEstimate::bytes_held() const {
  return probes_.size() * static_cast<int64_t>(sizeof(float)) +
         (first_gains_.size() + second_gains_.size() + third_gains_.size()) *
             static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
