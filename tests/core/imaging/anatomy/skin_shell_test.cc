// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/skin_shell.h"

#include <cmath>
#include <functional>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/outer_skin.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

constexpr double kBallMm = 30;
constexpr double kThicknessMm = 3;
constexpr double kVoxelMm = 0.75;

// A ball of soft tissue with what `hu` says of a place in it.
HeadSegmentation Ball(const std::function<int(const Vector3d&)>& hu) {
  HeadSegmentation head;
  head.hu = HuGrid(
      {.size = {100, 100, 100}, .origin_mm = Vector3d::Constant(-37.2), .spacing_mm = kVoxelMm},
      -1000);
  head.head = LabelGrid(head.hu.geometry);
  head.bone = LabelGrid(head.hu.geometry);
  ForEachVoxel(LabelGrid(head.hu.geometry, 1), [&](size_t index, const Vector3d& place) {
    if (place.norm() < kBallMm) head.hu.values[index] = static_cast<int16_t>(hu(place));
    head.head.values[index] = head.hu.values[index] > -500 ? 1 : 0;
    head.bone.values[index] = head.hu.values[index] > 250 ? 1 : 0;
  });
  return head;
}

// A mouth in front (-y), about z = 0.
Landmarks FrontLandmarks() {
  Landmarks l;
  l.midsagittal = {Vector3d::Zero(), Vector3d::UnitX()};
  l.upper_teeth = {Vector3d::Zero(), Vector3d::UnitZ()};
  l.upper_lip = l.lower_lip = {0, -kBallMm, 0};
  l.upper_incisor = {0, -20, 2};
  l.lower_incisor = {0, -20, -2};
  return l;
}

// Of the directions that are asked for, the least and the largest depth up to which the shell
// reaches without a gap from the skin inwards.
struct Depths {
  double least = 1e9;
  double largest = 0;
};
Depths DepthsOf(const LabelGrid& shell, const std::function<bool(const Vector3d&)>& asked) {
  Depths depths;
  for (int i = -20; i < 20; ++i) {
    for (int j = 0; j < 90; ++j) {
      const double latitude = 0.07 * i;
      const double longitude = 0.07 * j;
      const Vector3d direction(std::cos(latitude) * std::cos(longitude),
                               std::cos(latitude) * std::sin(longitude), std::sin(latitude));
      if (!asked(direction)) continue;
      int tenths = 0;
      // From half a voxel behind the skin, where its first voxel is.
      for (; tenths < 200; ++tenths) {
        const double at_depth = 0.1 * tenths;
        const Vector3d at = shell.geometry.ToVoxels((kBallMm - kVoxelMm - at_depth) * direction);
        const Eigen::Vector3i voxel = at.array().round().cast<int>();
        if (shell.At(voxel.x(), voxel.y(), voxel.z()) == 0) break;
      }
      const double depth = 0.1 * tenths + kVoxelMm;
      depths.least = std::min(depths.least, depth);
      depths.largest = std::max(depths.largest, depth);
    }
  }
  return depths;
}

LabelGrid Shell(const HeadSegmentation& head) {
  return SkinShell(head, OutsideAir(head), FrontLandmarks(), kThicknessMm);
}

bool Anywhere(const Vector3d& /*direction*/) { return true; }

TEST(SkinShellTest, AWallOf1MmIsThickenedInwardIntoAir) {
  const HeadSegmentation head = Ball([](const Vector3d& p) { return p.norm() > 29 ? 40 : -1000; });
  const Depths depths = DepthsOf(Shell(head), Anywhere);
  EXPECT_GE(depths.least, kThicknessMm - 0.9 * kVoxelMm);
  EXPECT_LE(depths.largest, kThicknessMm + 1.5 * kVoxelMm);
}

TEST(SkinShellTest, BoneUnderThinSkinBecomesTissue) {
  const HeadSegmentation head = Ball([](const Vector3d& p) { return p.norm() > 29 ? 40 : 1500; });
  const Depths depths = DepthsOf(Shell(head), Anywhere);
  EXPECT_GE(depths.least, kThicknessMm - 0.9 * kVoxelMm);
  EXPECT_LE(depths.largest, kThicknessMm + 1.5 * kVoxelMm);
}

TEST(SkinShellTest, NothingBeforeTheSkinBelongsToIt) {
  const HeadSegmentation head = Ball([](const Vector3d&) { return 40; });
  const LabelGrid shell = Shell(head);
  ForEachVoxel(shell, [&](size_t index, const Vector3d& place) {
    ASSERT_GT(head.hu.values[index], -500) << place.transpose();
  });
}

// A nostril of 8 mm from below into a hollow.
TEST(SkinShellTest, ANostrilIsNotPlugged) {
  const auto in_nostril = [](const Vector3d& p) {
    return std::hypot(p.x(), p.y()) < 4 && p.z() < 0;
  };
  const HeadSegmentation head =
      Ball([&](const Vector3d& p) { return p.norm() < 27 || in_nostril(p) ? -1000 : 40; });
  const LabelGrid shell = Shell(head);
  ForEachVoxel(shell, [&](size_t /*index*/, const Vector3d& place) {
    // The rim is thickened, the middle stays open.
    ASSERT_FALSE(std::hypot(place.x(), place.y()) < 2 && place.z() < -20) << place.transpose();
  });
  EXPECT_GE(DepthsOf(shell, [](const Vector3d& d) { return d.z() > 0; }).least, 2.4);
}

// The layer before the teeth is half air: tissue by its HU.
TEST(SkinShellTest, BlurredEdgesOfExposedTeethGetNoSkin) {
  const auto in_mouth = [](const Vector3d& p) {
    return std::abs(p.z()) < 9 && std::abs(p.x()) < 16 && p.y() < -20;
  };
  // Bare in the middle, blurred all round.
  const auto in_teeth = [](const Vector3d& p) {
    return std::abs(p.z()) < 9 && std::abs(p.x()) < 16 && p.y() >= -20 && p.y() < -14;
  };
  const auto blurred = [](const Vector3d& p) { return p.y() < -19.5 && std::abs(p.x()) > 5; };
  const HeadSegmentation head = Ball([&](const Vector3d& p) {
    return in_mouth(p) ? -1000 : !in_teeth(p) ? 40 : blurred(p) ? 100 : 2500;
  });
  const LabelGrid shell = Shell(head);
  int bone = 0;
  ForEachVoxel(head.bone, [&](size_t index, const Vector3d& place) {
    if (!in_teeth(place) || std::abs(place.z()) > 5 || std::abs(place.x()) > 11) return;
    ASSERT_EQ(shell.values[index], 0) << place.transpose();
    ++bone;
  });
  EXPECT_GT(bone, 1000);
}

// Teeth in a mouth that is wide open, 10 mm behind the lips: no skin is made over them.
TEST(SkinShellTest, ExposedTeethGetNoSkin) {
  const auto in_mouth = [](const Vector3d& p) {
    return std::abs(p.z()) < 9 && std::abs(p.x()) < 16 && p.y() < -20;
  };
  const auto in_teeth = [](const Vector3d& p) {
    return std::abs(p.z()) < 9 && std::abs(p.x()) < 16 && p.y() >= -20 && p.y() < -15;
  };
  const HeadSegmentation head = Ball([&](const Vector3d& p) {
    return in_mouth(p) ? -1000 : in_teeth(p) ? 2500 : 40;
  });
  const LabelGrid shell = Shell(head);
  int teeth_facing = 0;
  const LabelGrid facing = VoxelsFacing(OutsideAir(head), head.bone);
  ForEachVoxel(LabelGrid(shell.geometry, 1), [&](size_t index, const Vector3d& place) {
    if (!in_teeth(place) || std::abs(place.z()) > 5 || std::abs(place.x()) > 12) return;
    ASSERT_EQ(shell.values[index], 0) << place.transpose();
    teeth_facing += facing.values[index];
  });
  EXPECT_GT(teeth_facing, 200) << "the mouth is open to the outside";
}

TEST(WithoutSingleLayersTest, SheetsOfOneVoxelGoAndBlocksStay) {
  LabelGrid mask({.size = {8, 8, 8}, .spacing_mm = 1});
  for (int y = 0; y < 8; ++y) {
    for (int z = 0; z < 8; ++z) {
      mask.At(1, y, z) = 1;
      mask.At(4, y, z) = 1;
      mask.At(5, y, z) = 1;
    }
  }
  const LabelGrid kept = WithoutSingleLayers(mask);
  EXPECT_EQ(CountVoxels(kept), 2 * 64);
  EXPECT_EQ(kept.At(1, 3, 3), 0);
  EXPECT_EQ(kept.At(5, 7, 7), 1);
}

}  // namespace
}  // namespace tissueform
