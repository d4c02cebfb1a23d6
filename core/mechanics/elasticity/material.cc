// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/material.h"

#include "absl/strings/str_cat.h"

namespace tissueform {

ElasticModuli ModuliOf(double youngs_modulus, double poisson_ratio) {
  const double incompressibility = 1.0 - 2.0 * poisson_ratio;
  const double shear = youngs_modulus / (2.0 * (1.0 + poisson_ratio));
  return {2.0 * shear * poisson_ratio / incompressibility, shear,
          youngs_modulus / (3.0 * incompressibility)};
}

absl::Status CheckPoissonRatio(double poisson_ratio) {
  if (poisson_ratio >= 0.0 && poisson_ratio < 0.5) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("Poisson's ratio is ", poisson_ratio, "; it must be at least 0 and below 0.5"));
}

}  // namespace tissueform
