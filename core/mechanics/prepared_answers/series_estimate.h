// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/mechanics/answer_evaluator/portable_answers.h"

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
// With u3 / (1 + q), q = |u3| / |u2| (ThirdOrderDamping), of fourth order: the larger one of
//   c (|u2| s2)^(3/4) / L^(1/2) q / (1 + q)   and   c' s3 q / (1 + q),
// s3 of the single triples as s2 is of the pairs, each with a measure of its own. Over ten bodies
// (three heads, five bars, a block, a tongue; 25 to 150 random poses each) the 99th percentile of
// errors over this is 1.2 to 2.2 times their median over the few small poses that c and c' are
// measured by, and 4 times of bars six and eight times as long as thick; of the first alone up to
// 3.4 and 6. The second alone is exceeded tenfold where a slender bar is twisted.
class SeriesEstimate {
 public:
  // What a pose is in the series.
  struct Terms {
    Eigen::VectorXd pairs;    // PairProducts
    Eigen::VectorXd triples;  // TripleProducts; none where the second order is the last one
    double ratio = 0;         // q, of a third order
  };
  // Terms with what converged answers were measured to lie away.
  struct Measured {
    Terms terms;
    double error_mm = 0;
  };

  // Displacements of some vertices, 3 v + axis: `first` a unit of every number of a pose (see
  // PoseNumbers), `second` of every pair, `third` of every triple, or no columns where the second
  // order is the last one. c and c' are 1 until they are measured.
  SeriesEstimate(const Eigen::MatrixXd& first, const Eigen::MatrixXd& second,
                 const Eigen::MatrixXd& third, double size_mm);

  // Takes for c and c' `allowance` times the median of errors over the estimates with 1. Without
  // any that moves a vertex, as much as on the worst body that was tried.
  void Calibrate(const std::vector<Measured>& measured, double allowance);

  // Looks at the vertices that single pairs move most, at most 64 of them.
  double Mm(const Terms& terms) const;
  // How far a pose moves vertices in the first order, roughly.
  double FirstOrderMm(const Eigen::VectorXd& numbers) const {
    return first_gains_.cwiseProduct(numbers).norm();
  }

  // Writes size_mm, estimate_scale, first_gains, second_gains, probes and third_gains: those by
  // which c' s3 is the length of their products with the triples.
  void Describe(PortableAnswers* answers) const;

  int64_t bytes_held() const;

 private:
  // Each with c or c' = 1, without what is made of q.
  double BySecondOrder(const Eigen::VectorXd& pairs) const;
  double ByThirdOrder(const Eigen::VectorXd& triples) const {
    return third_gains_.cwiseProduct(triples).norm();
  }

  double size_mm_;
  double second_scale_ = 1;  // c
  double third_scale_ = 1;   // c'
  // The largest displacement that every number, pair and triple gives a vertex.
  Eigen::VectorXd first_gains_;
  Eigen::VectorXd second_gains_;
  Eigen::VectorXd third_gains_;
  Eigen::MatrixXf probes_;  // of the second order, 3 rows for each, a column for every pair
};

}  // namespace tissueform
