// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/lip_contact.h"

#include <cmath>

#include "gtest/gtest.h"

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/soft_tissue.h"

namespace tissueform {
namespace {

constexpr double kGapMm = 4;       // between the lips
constexpr double kLipDepthMm = 9;  // from the skin to the teeth

// A slab of lips before a slab of teeth, as labels: skin at y = -9, teeth from y = 0 to 6, behind
// them the mouth's air and, from y = 16, a tongue. The gap between the lips about z = 0 goes
// through to the mouth; where `is_joined` holds of x, tissue bridges it from y = -9 + `notch_mm` to
// the teeth.
template <typename Joined>
LabelGrid Mouth(Joined is_joined, double notch_mm = 0) {
  GridGeometry geometry;
  geometry.size = {61, 71, 41};
  geometry.spacing_mm = 1;
  geometry.origin_mm = {-30, -30, -20};
  LabelGrid labels(geometry);
  ForEachVoxel(LabelGrid(geometry, 1), [&](size_t index, const Eigen::Vector3d& p) {
    const bool in_gap = std::abs(p.z()) < kGapMm / 2;
    const double front = in_gap ? -kLipDepthMm + notch_mm : -kLipDepthMm;
    const bool lips = p.y() >= front && p.y() < 0 && (!in_gap || is_joined(p.x()));
    const bool teeth = p.y() >= 0 && p.y() < 6 && !in_gap;
    if (lips || p.y() >= 16) labels.values[index] = kSoftTissue;
    if (teeth) labels.values[index] = 1;
  });
  return labels;
}

Landmarks MouthLandmarks() {
  Landmarks landmarks;
  landmarks.midsagittal = {Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX()};
  landmarks.upper_teeth = {Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()};
  landmarks.upper_lip = {0, -kLipDepthMm, 8};
  landmarks.lower_lip = {0, -kLipDepthMm, -8};
  return landmarks;
}

TEST(LipContactTest, PartedLipsHaveNoContactDespiteATongueBehind) {
  const LipContact contact =
      MeasureLipContact(Mouth([](double) { return false; }), MouthLandmarks());
  EXPECT_GT(contact.examined_mm, 25);
  EXPECT_EQ(contact.width_mm, 0);
  EXPECT_EQ(contact.area_mm2, 0);
}

// The bridge's own size: as wide as it was made, as deep as the lips are behind their notch.
TEST(LipContactTest, ABridgeHasItsWidthItsDepthAndItsPlace) {
  const LipContact contact =
      MeasureLipContact(Mouth([](double x) { return x >= 2 && x <= 11; }, 3), MouthLandmarks());
  EXPECT_NEAR(contact.width_mm, 10, 1);
  EXPECT_NEAR(contact.area_mm2, 10 * (kLipDepthMm - 3), 15);
  EXPECT_NEAR(contact.depth_mm, kLipDepthMm - 3, 1);
  EXPECT_NEAR(contact.place_mm.x(), 6.5, 1);
  EXPECT_NEAR(contact.place_mm.y(), -3, 1);
  EXPECT_NEAR(contact.place_mm.z(), 0, 2);
}

TEST(LipContactTest, AClosedMouthIsJoinedAllAlong) {
  const LipContact contact =
      MeasureLipContact(Mouth([](double) { return true; }), MouthLandmarks());
  EXPECT_EQ(contact.width_mm, contact.examined_mm);
}

TEST(LipContactTest, ThinSheetDoesNotCountAsContact) {
  const LipContact contact =
      MeasureLipContact(Mouth([](double) { return true; }, kLipDepthMm - 2), MouthLandmarks());
  EXPECT_EQ(contact.width_mm, 0);
}

}  // namespace
}  // namespace tissueform
