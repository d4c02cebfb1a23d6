// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <deque>

#include <Eigen/Core>

namespace tissueform {

// Anderson acceleration of a fixed-point iteration x <- g(x) (Anderson 1965; Walker and Ni 2011,
// type II): the next iterate is the combination of the last images g(x_i), weights summing to one,
// whose combined residual g(x_i) - x_i is smallest.
//
// Safeguard: when the residual has grown by more than kLargestGrowth against the smallest so far,
// the history is dropped and the plain iteration goes on from there, so a bad extrapolation costs
// one step.
class AndersonAcceleration {
 public:
  static constexpr double kLargestGrowth = 1.5;

  // `depth` differences are kept; 0 is the plain iteration.
  explicit AndersonAcceleration(int depth);

  // Next iterate from x and g(x). Both have the same shape in every call.
  Eigen::MatrixXd Next(const Eigen::MatrixXd& x, const Eigen::MatrixXd& image);

 private:
  const size_t depth_;
  double smallest_residual_;
  Eigen::MatrixXd last_image_;
  Eigen::MatrixXd last_residual_;
  std::deque<Eigen::MatrixXd> image_differences_;
  std::deque<Eigen::MatrixXd> residual_differences_;
};

}  // namespace tissueform
