// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "core/answer_evaluator/portable_answers.h"

namespace tissueform {

// What a series in the pose leaves out, told by its last order.
//
// Of first and second order:
//   c (|u2| s2)^(3/4) / L^(1/2),   of third order in the pose,
// |u2| how far that moves a vertex, s2 the root of the sum of the squares of what its single pairs
// do (which do not cancel), L the size of the mesh; c is measured. Of six bodies (heads and bars
// with one to three handles, 80 to 400 random poses each) the 99th percentile of errors over this
// is 2 to 4 times their median; over |u2|^2 / |u1| it is 2 to 5.5 times, over the squared sum of
// what the single pairs do at most 4 to 26 times.
//
// With u3 / (1 + q), q = |u3| / |u2| (ThirdOrderDamping), too:
//   c s3 q / (1 + q),   of fourth order in the pose,
// s3 of the single triples as s2 is of the pairs. Of six bodies (three heads, two bars, a tongue;
// 25 to 150 random poses) the 99th percentile of errors over this is 1.3 to 2.5 times their median
// over the few small poses that c is measured by; over the estimate of second order times q /
// (1 + q) it is 1.4 to 3.4 times, with how far u3 moves a vertex in place of s3 1.6 to 3.4 times.
class SeriesEstimate {
 public:
  // Displacements of some vertices, 3 v + axis: `first` a unit of every number of a pose (see
  // PoseNumbers), `second` of every pair (PairProducts), `third` of every triple (TripleProducts),
  // or no columns where the second order is the last one.
  SeriesEstimate(const Eigen::MatrixXd& first, const Eigen::MatrixXd& second,
                 const Eigen::MatrixXd& third, double size_mm);

  // With c = 1. Without a third order; looks at the vertices that single pairs move most, at most
  // 64 of them.
  double UnscaledMm(const Eigen::VectorXd& pairs) const;
  // With it.
  double UnscaledMm(const Eigen::VectorXd& triples, double ratio) const {
    return third_gains_.cwiseProduct(triples).norm() * ratio / (1 + ratio);
  }
  // How far a pose moves vertices in the first order, roughly.
  double FirstOrderMm(const Eigen::VectorXd& numbers) const {
    return first_gains_.cwiseProduct(numbers).norm();
  }

  void set_scale(double scale) { scale_ = scale; }
  double scale() const { return scale_; }

  // Writes size_mm, estimate_scale, first_gains, and third_gains or second_gains and probes.
  void Describe(PortableAnswers* answers) const;

  int64_t bytes_held() const;

 private:
  double size_mm_;
  double scale_ = 1;
  // The largest displacement that every number, pair and triple gives a vertex: of the last order
  // and of the first.
  Eigen::VectorXd first_gains_;
  Eigen::VectorXd second_gains_;
  Eigen::VectorXd third_gains_;
  Eigen::MatrixXf probes_;  // of the second order, 3 rows for each, a column for every pair
};

}  // namespace tissueform
