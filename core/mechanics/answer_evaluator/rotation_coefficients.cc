// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/rotation_coefficients.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "core/mechanics/answer_evaluator/small_product.h"

namespace tissueform {
namespace {

// Responses fall with the degree; this allows for those of the second guard degree, which are not
// measured, not doing so.
constexpr double kGainAllowance = 1.5;
// For interpolating instead of approximating best.
constexpr double kLebesgueAllowance = 16;

// Rotation vector and scale, blended along harmonic values.
struct Blended {
  std::array<double, 3> rotation_vector = {};
  double scale = 1;
};

Blended BlendPoses(std::span<const AnswerPose> poses, const double* u) {
  Blended blend;
  for (size_t h = 0; h < poses.size(); ++h) {
    for (size_t axis = 0; axis < 3; ++axis) {
      blend.rotation_vector[axis] += u[h] * poses[h].rotation_vector[axis];
    }
    blend.scale += u[h] * (poses[h].scale - 1);
  }
  return blend;
}

// Of turning by vectors in a ball of radius r, after polynomials of degree n.
double RemainderOf(double r, int n) {
  double taylor = 1;
  for (int k = 1; k <= n + 1; ++k) taylor *= r / k;
  return std::min(1.0, std::ldexp(kLebesgueAllowance, -n)) * taylor;
}

}  // namespace

double RemainderBound(const PortableAnswers& answers, std::span<const AnswerPose> poses,
                      int degree) {
  std::vector<double> u = answers.simplex_low;
  std::vector<Blended> corners = {BlendPoses(poses, u.data())};
  for (size_t h = 0; h < poses.size(); ++h) {
    u[h] += answers.numbers.simplex_width;
    corners.push_back(BlendPoses(poses, u.data()));
    u[h] = answers.simplex_low[h];
  }
  // Mixed rotation vectors fill the polytope of the corners, and the furthest two points of that
  // are two corners.
  double diameter = 0;
  double smallest = corners.front().scale;
  double largest = smallest;
  for (const Blended& a : corners) {
    for (const Blended& b : corners) {
      diameter = std::max(diameter, std::hypot(a.rotation_vector[0] - b.rotation_vector[0],
                                               a.rotation_vector[1] - b.rotation_vector[1],
                                               a.rotation_vector[2] - b.rotation_vector[2]));
    }
    smallest = std::min(smallest, a.scale);
    largest = std::max(largest, a.scale);
  }
  if (diameter == 0) return 0;  // the scale alone is linear in u
  const auto k = static_cast<double>(poses.size());
  const double radius = diameter * std::sqrt(k / (2 * k + 2));
  return 0.5 * (largest + smallest) * RemainderOf(radius, degree) +
         0.5 * (largest - smallest) * RemainderOf(radius, degree - 1);
}

RotationCoefficients ExpandRotation(const PortableAnswers& answers,
                                    std::span<const AnswerPose> poses) {
  const size_t nodes = answers.nodes.size() / poses.size();
  std::vector<double> at_nodes(9 * nodes);
  for (size_t node = 0; node < nodes; ++node) {
    const Blended blend = BlendPoses(poses, answers.nodes.data() + node * poses.size());
    const std::array<double, 9> turn = TurnMinusIdentity(blend.rotation_vector, blend.scale);
    std::copy(turn.begin(), turn.end(), at_nodes.begin() + static_cast<ptrdiff_t>(9 * node));
  }
  RotationCoefficients result;
  result.coefficients.resize(9 * nodes);
  MultiplySmall(answers.interpolation.data(), at_nodes.data(), {nodes, nodes, 9},
                result.coefficients.data());
  std::vector<double> sizes(nodes);
  for (size_t n = 0; n < nodes; ++n) sizes[n] = RowNorm(result.coefficients.data() + 9 * n, 9);
  const std::vector<double>& gains = answers.guard_gains;
  if (gains.empty()) return result;
  const auto first = static_cast<size_t>(answers.numbers.num_polynomials);
  for (size_t g = 0; g < gains.size(); ++g) result.truncation_mm += sizes[first + g] * gains[g];
  const double largest = *std::max_element(gains.begin(), gains.end());
  for (size_t n = first + gains.size(); n < nodes; ++n) {
    result.truncation_mm += kGainAllowance * largest * sizes[n];
  }
  result.truncation_mm += answers.numbers.largest_gain_mm *
                          RemainderBound(answers, poses, static_cast<int>(answers.numbers.degree));
  return result;
}

}  // namespace tissueform
