// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/material.h"

#include <limits>

#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::IsOk;
using testing::StatusIs;

TEST(MaterialTest, ModuliAgreeWithEachOther) {
  for (const double nu : {0.0, 0.2, 0.45, 0.499}) {
    const ElasticModuli moduli = ModuliOf(3000.0, nu);
    EXPECT_NEAR(moduli.bulk, moduli.first_lame + 2.0 / 3.0 * moduli.shear, 1e-9 * moduli.bulk);
    // Young's modulus and Poisson's ratio again.
    const double sum = moduli.first_lame + moduli.shear;
    EXPECT_NEAR(moduli.shear * (3 * moduli.first_lame + 2 * moduli.shear) / sum, 3000.0, 1e-7);
    EXPECT_NEAR(moduli.first_lame / (2 * sum), nu, 1e-12);
  }
}

TEST(MaterialTest, PoissonRatioLiesBelowOneHalf) {
  EXPECT_THAT(CheckPoissonRatio(0.0), IsOk());
  EXPECT_THAT(CheckPoissonRatio(0.4999), IsOk());
  for (const double nu : {-0.1, 0.5, 0.7, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THAT(CheckPoissonRatio(nu),
                StatusIs(absl::StatusCode::kInvalidArgument, ::testing::HasSubstr("below 0.5")));
  }
}

}  // namespace
}  // namespace tissueform
