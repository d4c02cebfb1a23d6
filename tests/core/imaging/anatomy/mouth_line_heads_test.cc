// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The mouth line on whole heads: phantoms, and a CT against what pictures of it show.

#include <algorithm>
#include <cmath>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/mouth_line.h"
#include "core/imaging/anatomy/skin_regions.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::HeadPhantom;
using testing::TestDataPath;

struct Mouth {
  HeadSegmentation head;
  Landmarks landmarks;
  MouthLine line;

  Eigen::Vector3d Place(const MouthLinePoint& point) const {
    return FaceAxes(landmarks).Place(point.at);
  }
  Eigen::Vector3d right_corner() const { return Place(line.points.front()); }
  Eigen::Vector3d left_corner() const { return Place(line.points.back()); }
  Eigen::Vector3d middle() const {
    return Place(*std::min_element(line.points.begin(), line.points.end(),
                                   [](const MouthLinePoint& a, const MouthLinePoint& b) {
                                     return std::abs(a.at.left) < std::abs(b.at.left);
                                   }));
  }
};

absl::StatusOr<Mouth> MouthOf(const HuGrid& ct, const LabelGrid& metal = {}) {
  Mouth mouth;
  TF_ASSIGN_OR_RETURN(mouth.head, SegmentHead(ct, {}, nullptr, metal));
  TF_ASSIGN_OR_RETURN(const BoneParts parts, SeparateBoneParts(mouth.head));
  TF_ASSIGN_OR_RETURN(mouth.landmarks, FindLandmarks(mouth.head, parts));
  TF_ASSIGN_OR_RETURN(mouth.line, FindMouthLine(mouth.head, mouth.landmarks));
  return mouth;
}

// Where the regions of the lips meet in the midline, by steps of 0.1 mm.
Eigen::Vector3d BorderOfLips(const Mouth& mouth) {
  const FaceAxes axes(mouth.landmarks);
  FaceCoordinates at = axes.Of(mouth.landmarks.upper_lip);
  const auto region = [&] {
    return NameSkinRegions(axes.Place(at).transpose(), mouth.landmarks, &mouth.line).front();
  };
  EXPECT_EQ(region(), SkinRegion::kUpperLip);
  for (int step = 0; step < 400 && region() == SkinRegion::kUpperLip; ++step) at.up -= 0.1;
  EXPECT_EQ(region(), SkinRegion::kLowerLip);
  return axes.Place(at);
}

// Of the slit of air between the phantom's lips: from z = -47 to -41, out to x = 22 mm.
void ExpectLineInTheSlit(const Mouth& mouth) {
  EXPECT_TRUE(mouth.line.line_is_sure());
  EXPECT_GT(mouth.line.parted_share, 0.9);
  for (const MouthLinePoint& point : mouth.line.points) {
    if (!point.parted) continue;
    EXPECT_NEAR(mouth.Place(point).z(), -44, 1);
  }
  EXPECT_EQ(mouth.line.right_corner, MouthCornerReason::kNotchEnds);
  EXPECT_EQ(mouth.line.left_corner, MouthCornerReason::kNotchEnds);
  EXPECT_NEAR(mouth.right_corner().x(), -22, 2);
  EXPECT_NEAR(mouth.left_corner().x(), 22, 2);
}

TEST(MouthLineHeadsTest, PartedLipsOfAPhantomAreFound) {
  ASSERT_OK_AND_ASSIGN(const Mouth mouth, MouthOf(HeadPhantom()));
  ExpectLineInTheSlit(mouth);
  EXPECT_EQ(mouth.line.start, MouthStart::kUpperIncisors);
  EXPECT_FALSE(mouth.line.near_metal);
}

// Ridges of bone in place of the teeth.
TEST(MouthLineHeadsTest, WithoutTeethTheSearchBeginsMidwayBetweenTheJaws) {
  HuGrid ct = HeadPhantom();
  for (int16_t& hu : ct.values) hu = std::min<int16_t>(hu, 1100);
  ASSERT_OK_AND_ASSIGN(const Mouth mouth, MouthOf(ct));
  EXPECT_EQ(mouth.line.start, MouthStart::kJawRidges);
  const FaceAxes axes(mouth.landmarks);
  EXPECT_DOUBLE_EQ(
      mouth.line.start_up,
      (axes.Of(mouth.landmarks.upper_incisor).up + axes.Of(mouth.landmarks.lower_incisor).up) / 2);
  ExpectLineInTheSlit(mouth);
  EXPECT_NEAR(BorderOfLips(mouth).z(), -44, 1);
  EXPECT_THAT(DescribeMouthLine(mouth.line)[0], HasSubstr("upper front teeth are missing"));
}

// The field of view ends 7 mm before the lips and 7 mm behind the tip of the nose.
TEST(MouthLineHeadsTest, ACutOffNoseIsNotALip) {
  const HuGrid whole = HeadPhantom();
  VoxelBox box;
  box.last = {whole.geometry.size[0] - 1, whole.geometry.size[1] - 1, whole.geometry.size[2] - 1};
  box.first[1] = static_cast<int>(std::lround(whole.geometry.ToVoxels({0, -89, 0}).y()));
  ASSERT_OK_AND_ASSIGN(const Mouth mouth, MouthOf(Crop(whole, box)));
  ASSERT_FALSE(mouth.head.cut.values.empty());
  EXPECT_NEAR(mouth.landmarks.nose_tip.y(), -89, 2);
  ExpectLineInTheSlit(mouth);
}

// Brackets on the upper front teeth.
TEST(MouthLineHeadsTest, MetalInTheMouthIsReported) {
  HuGrid ct = HeadPhantom();
  LabelGrid metal(ct.geometry);
  ForEachVoxel(LabelGrid(ct.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
    const bool is_bracket = std::abs(place.x()) < 10 && std::abs(place.y() + 64) < 2.5 &&
                            std::abs(place.z() + 36) < 2.5;
    if (!is_bracket) return;
    ct.values[index] = 3071;
    metal.values[index] = 1;
  });
  ASSERT_OK_AND_ASSIGN(const Mouth mouth, MouthOf(ct, metal));
  EXPECT_TRUE(mouth.line.near_metal);
  ExpectLineInTheSlit(mouth);
  EXPECT_THAT(DescribeMouthLine(mouth.line)[0], HasSubstr("Metal is near"));
}

// The bundled head: its mouth is open, and a tube hides the left half of the lower lip. Places by
// eye in a shaded relief and in slices, of which the corners are good to about 2 mm.
TEST(MouthLineHeadsTest, OnALivingHeadTheLineIsWhereTheEyeSeesIt) {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  ASSERT_OK_AND_ASSIGN(const CtVolume volume,
                       ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options));
  for (const double spacing_mm : {1.5, 2.5}) {
    SCOPED_TRACE(spacing_mm);
    ASSERT_OK_AND_ASSIGN(const HuGrid ct, ResampleIsotropic(volume, spacing_mm));
    ASSERT_OK_AND_ASSIGN(const Mouth mouth, MouthOf(ct));
    EXPECT_NEAR(mouth.middle().z(), -100.3, 2);
    EXPECT_GT(mouth.line.parted_share, 0.3);
    EXPECT_FALSE(mouth.line.line_is_sure());
    EXPECT_EQ(mouth.line.right_corner, MouthCornerReason::kNotchEnds);
    EXPECT_LT((mouth.right_corner() - Eigen::Vector3d(-121.5, 47.5, -97.5)).norm(), 5);
    EXPECT_EQ(mouth.line.left_corner, MouthCornerReason::kNoNotch);
    EXPECT_LT((mouth.left_corner() - Eigen::Vector3d(-71.5, 45.9, -96)).norm(), 5);
    EXPECT_NEAR(BorderOfLips(mouth).z(), -100.3, 2);
  }
}

}  // namespace
}  // namespace tissueform
