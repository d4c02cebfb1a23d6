// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/series_calibration.h"

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

std::vector<double> Gains(const Eigen::MatrixXd& columns) {
  std::vector<double> gains;
  for (const auto column : columns.colwise()) gains.push_back(LargestMove(column).second);
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

void DescribeSeries(const Eigen::MatrixXd& first, const Eigen::MatrixXd& second,
                    const Eigen::MatrixXd& third, double size_mm, PortableAnswers* answers) {
  answers->numbers.size_mm = size_mm;
  answers->numbers.estimate_scale = 1;
  answers->first_gains = Gains(first);
  answers->second_gains = Gains(second);
  answers->third_gains = Gains(third);
  const std::vector<Eigen::Index> vertices = MostMoved(second);
  answers->probes.clear();
  for (Eigen::Index c = 0; c < second.cols(); ++c) {
    for (const Eigen::Index vertex : vertices) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        answers->probes.push_back(static_cast<float>(second(3 * vertex + axis, c)));
      }
    }
  }
}

void CalibrateSeries(const std::vector<MeasuredSeries>& measured, double allowance,
                     PortableAnswers* answers) {
  constexpr double kWorstScale = 50;
  std::vector<double> by_second;
  std::vector<double> by_third;
  for (const auto& [terms, error_mm] : measured) {
    const double part = terms.triples.empty() ? 1 : terms.ratio / (1 + terms.ratio);
    const double second = part * SecondOrderErrorMm(*answers, terms.pairs);
    const double third = part * ThirdOrderErrorMm(*answers, terms.triples);
    if (second > 0) by_second.push_back(error_mm / second);
    if (third > 0) by_third.push_back(error_mm / third);
  }
  const auto scale = [allowance](std::vector<double> ratios) {
    return allowance * (ratios.empty() ? kWorstScale : Percentile(std::move(ratios), 50));
  };
  answers->numbers.estimate_scale = scale(std::move(by_second));
  const double third_scale = scale(std::move(by_third));
  for (double& gain : answers->third_gains) gain *= third_scale;
}

}  // namespace tissueform
