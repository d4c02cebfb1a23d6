// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tissueform {

// What is not known of a plan's material. The stiffness of each tissue is that of the problem times
// one factor: log-normal, 1 its median, between 1 / factor_95 and factor_95 in 95 of 100 cases; the
// tissues' factors are independent of each other.
struct MaterialUncertainty {
  struct Tissue {
    std::string name;      // for people: "tissue 2"
    double factor_95 = 1;  // at least 1, which is: known

    friend bool operator==(const Tissue&, const Tissue&) = default;
  };
  std::vector<Tissue> tissues;
  std::vector<int32_t> tissue_of_tet;  // #T
  // Poisson's ratio of all tissue: between these in 95 of 100 cases, the problem's own its median.
  // REQUIRES: the problem's own lies between them.
  std::optional<std::array<double, 2>> poisson_ratio_95;

  friend bool operator==(const MaterialUncertainty&, const MaterialUncertainty&) = default;
};

// More kinds of tissue are refused: each costs back-substitutions, and each pair of them. Factors
// above the largest, or a Poisson's ratio nearer to 0.5, are no range of the material but none
// known.
inline constexpr int kMaxTissues = 16;
inline constexpr double kLargestFactor95 = 10;
inline constexpr double kLargestUncertainPoissonRatio = 0.499;

// The standard normal variable lies between minus and plus this in 95 of 100 cases.
inline constexpr double kNormal95 = 1.959963984540054;

}  // namespace tissueform
