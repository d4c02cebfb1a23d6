// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/bone_parts.h"

#include <cmath>

#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::AtPlaceOf;
using testing::DiceOverlap;
using ::testing::HasSubstr;
using testing::HeadPhantom;
using testing::HeadPhantomOptions;
using testing::HeadPhantomParts;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;

absl::StatusOr<BoneParts> PartsOf(const HeadPhantomOptions& options,
                                  const std::optional<Plane>& cut = std::nullopt) {
  const absl::StatusOr<HeadSegmentation> head = SegmentHead(HeadPhantom(options));
  if (!head.ok()) return head.status();
  return SeparateBoneParts(*head, cut);
}

double Overlap(const BoneParts& parts, const HeadPhantomOptions& options, uint8_t part) {
  const auto is_part = [=](uint8_t label) { return label == part; };
  const LabelGrid truth = AtPlaceOf(parts.labels.geometry, HeadPhantomParts(options));
  return DiceOverlap(MaskWhere(parts.labels, is_part), MaskWhere(truth, is_part));
}

TEST(BonePartsTest, JawsThatDoNotTouchArePiecesOfTheirOwn) {
  ASSERT_OK_AND_ASSIGN(const BoneParts parts, PartsOf({}));
  EXPECT_EQ(parts.separation, JawSeparation::kThreshold);
  EXPECT_GT(Overlap(parts, {}, kCranium), 0.999);
  EXPECT_GT(Overlap(parts, {}, kMandible), 0.999);
  EXPECT_GT(Overlap(parts, {}, kSpine), 0.999);
  EXPECT_GT(parts.confidence, 0.999);  // nothing touches the phantom's mandible
  EXPECT_GT(parts.occlusal_clearance, 0.9);
}

TEST(BonePartsTest, TeethInOcclusionAreCutBetweenTheRows) {
  HeadPhantomOptions options;
  options.teeth_touch = true;
  ASSERT_OK_AND_ASSIGN(const BoneParts parts, PartsOf(options));
  EXPECT_EQ(parts.separation, JawSeparation::kAutomaticCut);
  EXPECT_GT(Overlap(parts, options, kMandible), 0.99);
  EXPECT_GT(Overlap(parts, options, kCranium), 0.99);
  ASSERT_TRUE(parts.occlusal_plane.has_value());
  // Between the front teeth's edges, -47 and -41, where the rows do not touch.
  const Plane& plane = *parts.occlusal_plane;
  const double front_mm =
      plane.point_mm.z() - (-60 - plane.point_mm.y()) * plane.normal.y() / plane.normal.z();
  EXPECT_NEAR(front_mm, -44, 4);
  EXPECT_LT(parts.confidence, 0.995);
  EXPECT_GT(parts.confidence, 0.95);
}

TEST(BonePartsTest, TheCallersPlaneIsUsed) {
  HeadPhantomOptions options;
  options.teeth_touch = true;
  const Plane given = {{0, 0, -44}, Eigen::Vector3d::UnitZ()};
  ASSERT_OK_AND_ASSIGN(const BoneParts parts, PartsOf(options, given));
  EXPECT_EQ(parts.separation, JawSeparation::kGivenCut);
  EXPECT_EQ(parts.occlusal_plane->point_mm, given.point_mm);
  EXPECT_GT(Overlap(parts, options, kMandible), 0.995);
}

TEST(BonePartsTest, AHeadWithoutLowerJawIsRefused) {
  HeadPhantomOptions options;
  options.with_mandible = false;
  EXPECT_THAT(PartsOf(options), StatusIs(kInvalid, HasSubstr("no lower jaw in view")));
}

TEST(BonePartsTest, AnImageThatEndsOverTheJawIsRefused) {
  HeadPhantomOptions options;
  options.lowest_mm = -38;
  EXPECT_THAT(PartsOf(options), StatusIs(kInvalid, HasSubstr("no lower jaw in view")));
}

TEST(BonePartsTest, AnImageThatCutsTheChinOffIsRefused) {
  HeadPhantomOptions options;
  options.lowest_mm = -76;
  EXPECT_THAT(PartsOf(options),
              StatusIs(kInvalid, HasSubstr("cut off by the lower border of the image")));
}

}  // namespace
}  // namespace tissueform
