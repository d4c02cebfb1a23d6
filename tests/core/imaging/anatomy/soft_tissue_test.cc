// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/soft_tissue.h"

#include <algorithm>
#include <cmath>

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::HeadPhantom;
using testing::HeadPhantomOptions;
using testing::StatusIs;

RegionOfInterest WideRegion() {
  return {{{0, 500, 0}, -Eigen::Vector3d::UnitY()},
          {{0, 0, 500}, -Eigen::Vector3d::UnitZ()},
          {{0, 0, -500}, Eigen::Vector3d::UnitZ()}};
}

// A ball of soft tissue of 40 mm round a ball of bone of 15 mm. The scanner's blur makes the HU of
// both surfaces linear in the radius, over 3 mm.
constexpr double kSkinMm = 40;
constexpr double kBoneMm = 15;

double BallHu(double radius_mm) {
  const double skin = std::clamp((kSkinMm - radius_mm) / 3, -0.5, 0.5);
  const double bone = std::clamp((kBoneMm - radius_mm) / 3, -0.5, 0.5);
  return -500 + 1000 * skin + (bone + 0.5) * 500;
}

HeadSegmentation Ball() {
  GridGeometry geometry;
  geometry.size = {64, 64, 64};
  geometry.spacing_mm = 1.5;
  geometry.origin_mm = Eigen::Vector3d::Constant(-47.25) + Eigen::Vector3d(0.3, -0.2, 0.1);
  HeadSegmentation head;
  head.hu = HuGrid(geometry);
  head.head = LabelGrid(geometry);
  head.bone = LabelGrid(geometry);
  const LabelGrid all(geometry, 1);
  ForEachVoxel(all, [&](size_t index, const Eigen::Vector3d& place) {
    const auto hu = static_cast<int16_t>(std::lround(BallHu(place.norm())));
    head.hu.values[index] = hu;
    head.head.values[index] = hu > head.options.tissue_above_hu ? 1 : 0;
    head.bone.values[index] = hu > head.options.bone_above_hu ? 1 : 0;
  });
  return head;
}

// Where the field changes its sign between neighbours along x, interpolated linearly: visits the
// radius.
template <typename Visit>
void ForEachCrossing(const FloatGrid& field, Visit visit) {
  for (int z = 0; z < field.geometry.size[2]; ++z) {
    for (int y = 0; y < field.geometry.size[1]; ++y) {
      for (int x = 0; x + 1 < field.geometry.size[0]; ++x) {
        const double a = field.At(x, y, z);
        const double b = field.At(x + 1, y, z);
        if ((a > 0) == (b > 0)) continue;
        const Eigen::Vector3d step(field.geometry.spacing_mm * a / (a - b), 0, 0);
        visit(field.geometry.Centre(x, y, z) + step);
      }
    }
  }
}

double FieldVolumeMm3(const FloatGrid& field) {
  const auto inside = std::count_if(field.values.begin(), field.values.end(),
                                    [](float value) { return value > 0; });
  return static_cast<double>(inside) * VoxelVolumeMm3(field.geometry);
}

TEST(SoftTissueTest, TheFieldVanishesOnTheSurfacesOfTheCt) {
  const HeadSegmentation head = Ball();
  ASSERT_OK_AND_ASSIGN(const SoftTissue tissue,
                       ExtractSoftTissue(head, head.bone, Landmarks(), WideRegion()));
  double worst_mm = 0;
  int crossings = 0;
  ForEachCrossing(tissue.field, [&](const Eigen::Vector3d& place) {
    const double radius = place.norm();
    worst_mm = std::max(worst_mm, std::min(std::abs(radius - kSkinMm), std::abs(radius - kBoneMm)));
    ++crossings;
  });
  EXPECT_GT(crossings, 2000);
  EXPECT_LT(worst_mm, 0.1 * tissue.field.geometry.spacing_mm);
}

TEST(SoftTissueTest, PlanesCutExactly) {
  const HeadSegmentation head = Ball();
  RegionOfInterest region = WideRegion();
  region.above = {{0, 0, 21.37}, -Eigen::Vector3d::UnitZ()};
  ASSERT_OK_AND_ASSIGN(const SoftTissue tissue,
                       ExtractSoftTissue(head, head.bone, Landmarks(), region));
  const FloatGrid& field = tissue.field;
  const Eigen::Vector3d middle = field.geometry.ToVoxels({25, 0, 21.37});
  const auto x = static_cast<int>(middle.x());
  const auto y = static_cast<int>(middle.y());
  const auto z = static_cast<int>(middle.z());
  const double below = field.At(x, y, z);
  const double above = field.At(x, y, z + 1);
  const double height_mm =
      field.geometry.Centre(x, y, z).z() + field.geometry.spacing_mm * below / (below - above);
  EXPECT_NEAR(height_mm, 21.37, 1e-4);
}

TEST(SoftTissueTest, SheetsAndSmallCavitiesGo) {
  HeadSegmentation head = Ball();
  const LabelGrid all(head.hu.geometry, 1);
  ForEachVoxel(all, [&](size_t index, const Eigen::Vector3d& place) {
    const bool sheet = place.norm() > 38 && place.norm() < 46 && std::abs(place.z()) < 0.7;
    const bool bubble = (place - Eigen::Vector3d(0, 28, 0)).norm() < 2.2;
    const bool speck = (place - Eigen::Vector3d(0, -28, 0)).norm() < 2.2;
    if (sheet) head.hu.values[index] = 40;
    if (bubble) head.hu.values[index] = -1000;
    if (speck) head.hu.values[index] = 900;
    if (sheet) head.head.values[index] = 1;
    if (bubble) head.head.values[index] = 0;
    if (speck) head.bone.values[index] = 1;
  });
  ASSERT_OK_AND_ASSIGN(const SoftTissue tissue,
                       ExtractSoftTissue(head, head.bone, Landmarks(), WideRegion()));
  // Of the sheet a stump of less than two voxels stays.
  ForEachCrossing(tissue.field, [&](const Eigen::Vector3d& place) {
    const double radius = place.norm();
    ASSERT_LT(std::min(std::abs(radius - kSkinMm), std::abs(radius - kBoneMm)), 3)
        << place.transpose();
  });
}

TEST(SoftTissueTest, ARegionWithoutTissueIsRefused) {
  const HeadSegmentation head = Ball();
  RegionOfInterest region = WideRegion();
  region.below.point_mm.z() = 39;
  EXPECT_THAT(ExtractSoftTissue(head, head.bone, Landmarks(), region),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("move its planes")));
}

class SoftTissueOfPhantomTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(HeadPhantom()));
    ASSERT_OK_AND_ASSIGN(const BoneParts parts, SeparateBoneParts(head));
    ASSERT_OK_AND_ASSIGN(const Landmarks landmarks, FindLandmarks(head, parts));
    const OsteotomySegment jaw = DefaultSegment(OsteotomyKind::kBssro, "jaw", landmarks);
    ASSERT_OK_AND_ASSIGN(const LabelGrid bone, CutSegments(parts.labels, {jaw}));
    ASSERT_OK_AND_ASSIGN(
        tissue_, ExtractSoftTissue(head, bone, landmarks, DefaultRegion(landmarks, bone.geometry)));
  }

  size_t IndexOf(const Eigen::Vector3d& place) const {
    const Eigen::Vector3d p = tissue_.labels.geometry.ToVoxels(place);
    return static_cast<size_t>(tissue_.labels.geometry.Index(static_cast<int>(std::lround(p.x())),
                                                             static_cast<int>(std::lround(p.y())),
                                                             static_cast<int>(std::lround(p.z()))));
  }
  int LabelAt(const Eigen::Vector3d& place) const { return tissue_.labels.values[IndexOf(place)]; }
  double FieldAt(const Eigen::Vector3d& place) const {
    return tissue_.field.values[IndexOf(place)];
  }

  SoftTissue tissue_;
};

TEST_F(SoftTissueOfPhantomTest, EveryPlaceHasItsLabel) {
  EXPECT_EQ(LabelAt({55, -20, -40}), kSoftTissue) << "cheek";
  EXPECT_EQ(LabelAt({1, -78, 1}), kSoftTissue) << "nose";
  EXPECT_EQ(LabelAt({1, -59, -80}), 2) << "chin of the jaw that moves";
  EXPECT_EQ(LabelAt({1, -59, -35}), kFixedBone) << "upper teeth";
  EXPECT_EQ(LabelAt({1, 10, 10}), 0) << "brain";
  EXPECT_EQ(LabelAt({1, -46, -14}), 0) << "nasal cavity";
  EXPECT_LT(FieldAt({1, 10, 10}), 0);
  EXPECT_GT(FieldAt({55, -20, -40}), 0);
}

TEST_F(SoftTissueOfPhantomTest, AirPartsTheLips) {
  EXPECT_GT(FieldAt({1, -74, -38}), 0) << "upper lip";
  EXPECT_LT(FieldAt({1, -74, -44}), 0) << "between the lips";
  EXPECT_GT(FieldAt({1, -74, -50}), 0) << "lower lip";
}

TEST_F(SoftTissueOfPhantomTest, FieldAndLabelsHaveOneVolumeAndOneComponent) {
  const LabelGrid soft =
      MaskWhere(tissue_.labels, [](uint8_t label) { return label == kSoftTissue; });
  EXPECT_EQ(LabelComponents(soft, Neighbours::kFaces).voxels.size(), 1U);
  const LabelGrid inside = MaskWhere(tissue_.field, [](float value) { return value > 0; });
  EXPECT_EQ(LabelComponents(inside, Neighbours::kFaces).voxels.size(), 1U);
  EXPECT_NEAR(FieldVolumeMm3(tissue_.field), tissue_.volume_mm3, 0.02 * tissue_.volume_mm3);
}

}  // namespace
}  // namespace tissueform
