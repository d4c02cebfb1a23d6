// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// By how much a series' third order is believed. With q = |u3| / |u2|, root mean squares over the
// vertices,
//   u1 + u2 + u3 / (1 + q) :
// nearly all of it while the orders fall fast, and where they do not no more than the second moves;
// the whole of it makes large poses worse. On three heads at their plans' poses the face errs by
// 0.4 to 0.6 of what it does by second order, at one and a half times by 0.6 to 0.9 of it.
class ThirdOrderDamping {
 public:
  // Displacements of all vertices that are free: of every pair (PairProducts) and of every triple
  // (TripleProducts).
  ThirdOrderDamping(const Eigen::MatrixXd& second, const Eigen::MatrixXd& third);

  // q; 0 where the second order moves nothing.
  double Ratio(const Eigen::VectorXd& pairs, const Eigen::VectorXd& triples) const;

  // Writes second_lengths and third_lengths.
  void Describe(PortableAnswers* answers) const;

  int64_t bytes_held() const;

 private:
  // Any number of rows by pairs and by triples: their products are as long as the displacements of
  // all vertices are together, but for one factor of both.
  Eigen::MatrixXf second_lengths_;
  Eigen::MatrixXf third_lengths_;
};

}  // namespace tissueform
