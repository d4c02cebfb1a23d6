// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <span>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

inline constexpr size_t kNumbersPerHandle = 6;

// What poses are in the series of neo_hookean.
struct SeriesTerms {
  // Of every handle three numbers of its turn and the movement of its middle at rest, mm. Of the
  // turn not the angle itself but its sine, times the axis: what R - I is odd in, so that columns
  // which hold R - I whole and those of these numbers agree to third order either way. Scales are
  // left out.
  std::vector<double> numbers;
  // n_a n_b for all pairs a <= b, twice that where they differ.
  std::vector<double> pairs;
  // m n_a n_b n_c for all a <= b <= c, m as many as there are orders of the three. None where the
  // second order is the last one.
  std::vector<double> triples;
  // q, the length of the third order beside the second's, by which it is damped: u3 / (1 + q).
  double ratio = 0;
};

// Reads `centroids`. REQUIRES: a pose for every handle.
std::vector<double> NumbersOf(const PortableAnswers& answers, std::span<const AnswerPose> poses);

// With a third order reads `second_lengths` and `third_lengths`.
SeriesTerms TermsOf(const PortableAnswers& answers, std::vector<double> numbers);

// Estimates the error of truncating the series from its last order.
//
// Of first and second order:
//   c (|u2| s2)^(3/4) / L^(1/2),   of third order in the pose,
// |u2| how far that moves a vertex, s2 the root of the sum of the squares of what its single pairs
// do (which do not cancel), L the size of the mesh; c is measured. Of six bodies (heads and bars
// with one to three handles, 80 to 400 random poses each) the 99th percentile of errors over this
// is 2 to 4 times their median; over |u2|^2 / |u1| it is 2 to 5.5 times, over the squared sum of
// what the single pairs do at most 4 to 26 times.
//
// With u3 / (1 + q), of fourth order: the larger one of
//   c (|u2| s2)^(3/4) / L^(1/2) q / (1 + q)   and   c' s3 q / (1 + q),
// s3 of the single triples as s2 is of the pairs, each with a measure of its own. Over ten bodies
// (three heads, five bars, a block, a tongue; 25 to 150 random poses each) the 99th percentile of
// errors over this is 1.2 to 2.2 times their median over the few small poses that c and c' are
// measured by, and 4 times of bars six and eight times as long as thick; of the first alone up to
// 3.4 and 6. The second alone is exceeded tenfold where a slender bar is twisted.
double SeriesErrorMm(const PortableAnswers& answers, const SeriesTerms& terms);

// The two by themselves, without what is made of q: with `estimate_scale` as c, and with c' in
// `third_gains`. |u2| is looked for at the probes.
double SecondOrderErrorMm(const PortableAnswers& answers, const std::vector<double>& pairs);
double ThirdOrderErrorMm(const PortableAnswers& answers, const std::vector<double>& triples);

// How far poses move vertices in the first order, roughly.
double FirstOrderMm(const PortableAnswers& answers, const std::vector<double>& numbers);

}  // namespace tissueform
