// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/material_conversion.h"

#include <limits>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

MaterialUncertainty Ranges() {
  return {.tissues = {{"", 2}, {"", 1.5}},
          .tissue_of_tet = {0, 1, 1},
          .poisson_ratio_95 = {{0.4, 0.49}}};
}

TEST(MaterialConversionTest, RangesComeBack) {
  EXPECT_EQ(*ToMaterialUncertainty(ToProto(Ranges()), 3, 0.45), Ranges());
  MaterialUncertainty of_stiffness = Ranges();
  of_stiffness.poisson_ratio_95.reset();
  EXPECT_EQ(*ToMaterialUncertainty(ToProto(of_stiffness), 3, 0.45), of_stiffness);
}

TEST(MaterialConversionTest, RefusesInvalidRanges) {
  const auto refused = [](const v1::MaterialRanges& proto, const char* why) {
    EXPECT_THAT(ToMaterialUncertainty(proto, 3, 0.45),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)));
  };
  const v1::MaterialRanges good = ToProto(Ranges());
  v1::MaterialRanges bad = good;
  bad.set_tissues(std::string(2, '\0'));
  refused(bad, "ranges.tissues has 2 bytes; it must be one per tet, 3");
  bad.set_tissues(std::string("\0\1\2", 3));
  refused(bad, "gives tet 2 the tissue 2, but there are 2 factors");
  bad.set_tissues(std::string("\0\1\xff", 3));
  refused(bad, "the tissue 255");
  for (const double factor : {0.5, 0.0, -1.0, 11.0, std::numeric_limits<double>::quiet_NaN(),
                              std::numeric_limits<double>::infinity()}) {
    bad = good;
    bad.set_factors_95(1, factor);
    refused(bad, "a factor must be 1 to 10");
  }
  bad = good;
  bad.clear_factors_95();
  refused(bad, "ranges.factors_95 has 0 entries");
  for (int i = 0; i < 17; ++i) bad.add_factors_95(2);
  refused(bad, "has 17 entries; it must be 1 to 16");
  bad = good;
  bad.clear_highest_poisson_ratio();
  refused(bad, "must both be given");
  for (const double highest : {0.5, 0.43, 0.3, std::numeric_limits<double>::quiet_NaN()}) {
    bad.set_highest_poisson_ratio(highest);
    refused(bad, "and hold the session's, which is 0.45");
  }
}

TEST(MaterialConversionTest, BandsComeBack) {
  const Eigen::VectorXf band = Eigen::Vector3f(0.25F, 0, 1e-3F);
  EXPECT_EQ(*FloatsFromBytes(FloatBytes(band), 3), band);
  EXPECT_EQ(FloatBytes(Eigen::VectorXf()), "");
  EXPECT_THAT(FloatsFromBytes(FloatBytes(band), 2), StatusIs(absl::StatusCode::kInvalidArgument));
}

}  // namespace
}  // namespace tissueform
