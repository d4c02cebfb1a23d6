// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <limits>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/scanner_cut.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using tissueform::testing::StatusIs;

// A horseshoe with a rounded lower rim, as a jaw's, whose lowest point lies under the grid.
LabelGrid Horseshoe(double cut_off_mm) {
  LabelGrid grid({.size = {120, 80, 30}, .spacing_mm = 1});
  for (int z = 0; z < 30; ++z) {
    for (int y = 0; y < 80; ++y) {
      for (int x = 0; x < 120; ++x) {
        const double height = z + 0.5 + cut_off_mm;
        const double along = std::abs(std::hypot(x - 60, y - 70) - 45);
        const double half_width = 6 * std::sqrt(1 - std::pow(std::max(0.0, 1 - height / 9), 2));
        if (along < half_width && y < 70) grid.At(x, y, z) = 2;
      }
    }
  }
  return grid;
}

TEST(BorderCutTest, BoneThatDoesNotTouchTheBorderIsNotCut) {
  LabelGrid grid = Horseshoe(0);
  for (int i = 0; i < 120 * 80; ++i) grid.values[static_cast<size_t>(i)] = 0;
  EXPECT_FALSE(CutOffBelowMm(grid, 2).has_value());
  EXPECT_FALSE(CutOffBelowMm(Horseshoe(3), 1).has_value());
}

TEST(BorderCutTest, DistinguishesSmallCutsFromLargeOnes) {
  EXPECT_LT(CutOffBelowMm(Horseshoe(1), 2).value(), 3);
  EXPECT_GT(CutOffBelowMm(Horseshoe(6), 2).value(), 3);
  EXPECT_EQ(CutOffBelowMm(Horseshoe(20), 2).value(), std::numeric_limits<double>::infinity());
}

// The bundled head without its lowest slices: how much of its bone is missing is known.
class CutHeadTest : public ::testing::Test {
 protected:
  static absl::StatusOr<BoneParts> PartsFrom(int lowest_layer) {
    CtReadOptions options;
    options.axes = "RPI";
    options.hu_offset = -1024;
    TF_ASSIGN_OR_RETURN(
        const CtVolume volume,
        ReadCtVolume(testing::TestDataPath("ct/headsq/headsq_quarter.nhdr"), options));
    TF_ASSIGN_OR_RETURN(HuGrid ct, ResampleIsotropic(volume, 1.5));
    const auto [x, y, z] = ct.geometry.size;
    ct = Crop(ct, {{0, 0, lowest_layer}, {x - 1, y - 1, z - 1}});
    TF_ASSIGN_OR_RETURN(const HeadSegmentation head, SegmentHead(ct));
    return SeparateBoneParts(head);
  }
};

TEST_F(CutHeadTest, BoneThatIsCutLittleIsAcceptedAndMuchIsRefused) {
  ASSERT_OK_AND_ASSIGN(const BoneParts whole, PartsFrom(0));
  EXPECT_FALSE(whole.cut_off_mm.has_value());
  int lowest = 0;  // layer of the jaw
  while (!CutOffBelowMm(
      Crop(whole.labels, {{0, 0, lowest},
                          {whole.labels.geometry.size[0] - 1, whole.labels.geometry.size[1] - 1,
                           whole.labels.geometry.size[2] - 1}}),
      kMandible)) {
    ++lowest;
  }
  for (const int cut_layers : {0, 1}) {
    ASSERT_OK_AND_ASSIGN(const BoneParts cut, PartsFrom(lowest + cut_layers));
    ASSERT_TRUE(cut.cut_off_mm.has_value());
    EXPECT_NEAR(*cut.cut_off_mm, 1.5 * cut_layers, 1);
  }
  for (const int cut_layers : {4, 6}) {
    EXPECT_THAT(PartsFrom(lowest + cut_layers),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         HasSubstr("mm of the lower jaw are cut off by the lower border of the "
                                   "image")));
  }
}

}  // namespace
}  // namespace tissueform
