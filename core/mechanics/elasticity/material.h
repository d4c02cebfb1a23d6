// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

namespace tissueform {

// Constants of an isotropic material, in the unit of Young's modulus.
struct ElasticModuli {
  double first_lame = 0;  // lambda = E nu / ((1 + nu) (1 - 2 nu))
  double shear = 0;       // mu = E / (2 (1 + nu))
  double bulk = 0;        // K = E / (3 (1 - 2 nu)) = lambda + 2/3 mu
};

// REQUIRES: CheckPoissonRatio(poisson_ratio) is OK.
ElasticModuli ModuliOf(double youngs_modulus, double poisson_ratio);

// InvalidArgument unless 0 <= poisson_ratio < 0.5: at one half a material keeps its volume and the
// displacement alone no longer determines the stress.
absl::Status CheckPoissonRatio(double poisson_ratio);

}  // namespace tissueform
