// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/skin_regions.h"

#include <algorithm>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

namespace tissueform {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

// A face looking along -y, upright, its midline in x = 0.
Landmarks UprightFace() {
  Landmarks l;
  l.midsagittal = {{0, 0, 0}, Eigen::Vector3d::UnitX()};
  l.upper_teeth = {{0, 0, 0}, Eigen::Vector3d::UnitZ()};
  l.lower_teeth = l.upper_teeth;
  l.nose_tip = {0, -30, 30};
  l.subnasale = {0, -16, 20};
  l.upper_lip = {0, -18, 5};
  l.lower_lip = {0, -16, -7};
  l.skin_pogonion = {0, -14, -35};
  l.menton = {0, 0, -42};
  l.mouth_corner = {{25, -6, 0}, {-25, -6, 0}};
  return l;
}

Positions Rows(const std::vector<Eigen::Vector3d>& places) {
  Positions positions(static_cast<Eigen::Index>(places.size()), 3);
  for (size_t i = 0; i < places.size(); ++i) {
    positions.row(static_cast<Eigen::Index>(i)) = places[i].transpose();
  }
  return positions;
}

std::vector<SkinRegion> RegionsOf(const std::vector<Eigen::Vector3d>& places, const Landmarks& l) {
  return NameSkinRegions(Rows(places), l);
}

TEST(SkinRegionsTest, LandmarksLieInTheRegionsThatHaveTheirNames) {
  const Landmarks l = UprightFace();
  EXPECT_THAT(RegionsOf({l.nose_tip, l.upper_lip, l.lower_lip, l.skin_pogonion}, l),
              ElementsAre(SkinRegion::kNose, SkinRegion::kUpperLip, SkinRegion::kLowerLip,
                          SkinRegion::kChin));
}

// Midway between the lips is z = -1; the line lies higher, and higher still on the left.
TEST(SkinRegionsTest, LipsMeetAtTheMouthLine) {
  const Landmarks l = UprightFace();
  const FaceAxes axes(l);
  MouthLine mouth;
  for (const double x : {-20, 0, 20}) {
    mouth.points.push_back({.at = axes.Of({x, -16, 4 + 0.1 * x})});
  }
  mouth.seen_share = 0.6;
  std::vector<Eigen::Vector3d> over;
  std::vector<Eigen::Vector3d> under;
  for (const double x : {-26, -20, -7, 0, 13, 20, 26}) {
    const double z = 4 + 0.1 * std::clamp(x, -20.0, 20.0);
    over.emplace_back(x, -14, z + 0.1);
    under.emplace_back(x, -14, z - 0.1);
  }
  EXPECT_THAT(NameSkinRegions(Rows(over), l, &mouth), Each(SkinRegion::kUpperLip));
  EXPECT_THAT(NameSkinRegions(Rows(under), l, &mouth), Each(SkinRegion::kLowerLip));
  EXPECT_THAT(NameSkinRegions(Rows(under), l), Each(SkinRegion::kUpperLip)) << "midway is lower";
  mouth.seen_share = 0.4;
  EXPECT_THAT(NameSkinRegions(Rows(under), l, &mouth), Each(SkinRegion::kUpperLip));
  mouth.given = true;
  EXPECT_THAT(NameSkinRegions(Rows(under), l, &mouth), Each(SkinRegion::kLowerLip));
}

TEST(SkinRegionsTest, LeftIsThePatientsLeft) {
  EXPECT_THAT(RegionsOf({{45, 5, 0}, {-45, 5, 0}}, UprightFace()),
              ElementsAre(SkinRegion::kLeftCheek, SkinRegion::kRightCheek));
}

TEST(SkinRegionsTest, BackOfTheHeadForeheadAndNeckHaveNoRegion) {
  EXPECT_THAT(
      RegionsOf({{0, 150, 0}, {0, -10, 80}, {0, 0, -80}, {60, 80, 0}}, UprightFace()),
      ElementsAre(SkinRegion::kNone, SkinRegion::kNone, SkinRegion::kNone, SkinRegion::kNone));
}

TEST(SkinRegionsTest, RegionsMoveWithTheFace) {
  const Landmarks upright = UprightFace();
  const Eigen::Isometry3d pose =
      Eigen::Translation3d(100, -20, 7) *
      Eigen::Isometry3d(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 0.2, -0.1).normalized()));
  Landmarks moved = upright;
  for (Plane* plane : {&moved.midsagittal, &moved.upper_teeth, &moved.lower_teeth}) {
    *plane = {pose * plane->point_mm, pose.linear() * plane->normal};
  }
  for (Eigen::Vector3d* place :
       {&moved.nose_tip, &moved.subnasale, &moved.upper_lip, &moved.lower_lip, &moved.skin_pogonion,
        &moved.menton, &moved.mouth_corner.left, &moved.mouth_corner.right}) {
    *place = pose * *place;
  }
  std::vector<Eigen::Vector3d> places;
  for (int x = -60; x <= 60; x += 7) {
    for (int z = -60; z <= 60; z += 7) places.emplace_back(x, 0.01 * x * x - 12, z);
  }
  const std::vector<SkinRegion> before = RegionsOf(places, upright);
  for (Eigen::Vector3d& place : places) place = pose * place;
  EXPECT_EQ(RegionsOf(places, moved), before);
}

}  // namespace
}  // namespace tissueform
