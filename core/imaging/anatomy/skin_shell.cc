// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/skin_shell.h"

#include <algorithm>
#include <cmath>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/outer_skin.h"

namespace tissueform {
namespace {

// Where an open mouth shows teeth: a crown is 10 mm high, the front teeth reach 20 mm to either
// side, and lips lie 4 mm or more before them.
constexpr double kCrownMm = 10;
constexpr double kFrontTeethMm = 20;
constexpr double kLipMm = 4;

// The edge of a tooth is a voxel of tissue by its HU, half tooth and half air; taken for skin, it
// would turn the tooth behind it into a lip of 3 mm that ties the upper lip to the tongue. Only
// what has a face on bone, and only near a place where bone itself shows: a lip over a bracket is 3
// mm thin.
constexpr double kBlurVoxels = 1.1;
constexpr double kToothMm = 8;

// Ways from voxel to voxel are up to 8 % longer than straight ones, and end at centres.
constexpr double kStraight = 1.1;

class MouthWindow {
 public:
  explicit MouthWindow(const Landmarks& l)
      : landmarks_(l),
        low_mm_(std::min(l.lower_incisor.z(), l.upper_incisor.z()) - kCrownMm),
        high_mm_(std::max(l.lower_incisor.z(), l.upper_incisor.z()) + kCrownMm),
        front_(l.ForwardOf(l.upper_teeth)),
        lips_mm_(std::max(front_.dot(l.upper_lip), front_.dot(l.lower_lip)) - kLipMm) {}

  bool Contains(const Eigen::Vector3d& p) const {
    return p.z() > low_mm_ && p.z() < high_mm_ && front_.dot(p) < lips_mm_ &&
           std::abs(landmarks_.midsagittal.HeightMm(p)) < kFrontTeethMm;
  }

 private:
  const Landmarks& landmarks_;
  double low_mm_;
  double high_mm_;
  Eigen::Vector3d front_;
  double lips_mm_;
};

}  // namespace

LabelGrid WithoutSingleLayers(const LabelGrid& mask) {
  LabelGrid kept(mask.geometry);
  const auto [nx, ny, nz] = mask.geometry.size;
  const auto for_block = [](int x, int y, int z, const auto& visit) {
    for (int corner = 0; corner < 8; ++corner) {
      visit(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2));
    }
  };
  for (int z = 0; z + 1 < nz; ++z) {
    for (int y = 0; y + 1 < ny; ++y) {
      for (int x = 0; x + 1 < nx; ++x) {
        bool full = true;
        for_block(x, y, z, [&](int a, int b, int c) { full = full && mask.At(a, b, c) != 0; });
        if (full) for_block(x, y, z, [&](int a, int b, int c) { kept.At(a, b, c) = 1; });
      }
    }
  }
  return kept;
}

LabelGrid ExposedTeeth(const HeadSegmentation& head, const LabelGrid& outside_air,
                       const Landmarks& landmarks) {
  const LabelGrid solid =
      MaskWhere(head.hu, [&](int16_t hu) { return hu > head.options.tissue_above_hu; });
  LabelGrid teeth = VoxelsFacing(outside_air, solid);
  const MouthWindow mouth(landmarks);
  ForEachVoxel(LabelGrid(teeth), [&](size_t i, const Eigen::Vector3d& place) {
    if (!mouth.Contains(place)) teeth.values[i] = 0;
  });
  const FloatGrid to_bone = DistanceMm(head.bone);
  const FloatGrid to_shown = DistanceMm(Both(teeth, head.bone));
  const double blur_mm = kBlurVoxels * head.hu.geometry.spacing_mm;
  for (size_t i = 0; i < teeth.values.size(); ++i) {
    if (to_bone.values[i] > blur_mm || to_shown.values[i] > kToothMm) teeth.values[i] = 0;
  }
  return teeth;
}

LabelGrid SkinShell(const HeadSegmentation& head, const LabelGrid& outside_air,
                    const Landmarks& landmarks, double thickness_mm) {
  const double voxel_mm = head.hu.geometry.spacing_mm;
  const auto is_air = [&](size_t i) { return head.hu.values[i] <= head.options.tissue_above_hu; };
  // The centre of a voxel of air lies half a voxel before the skin.
  const double reach_mm = thickness_mm + voxel_mm / 2;
  const FloatGrid depth = DistanceMm(outside_air);
  const LabelGrid air =
      MaskWhere(head.hu, [&](int16_t hu) { return hu <= head.options.tissue_above_hu; });
  const VoxelGrid<float> way = DistanceWithin(air, outside_air, kStraight * (reach_mm + voxel_mm));

  const LabelGrid teeth = ExposedTeeth(head, outside_air, landmarks);
  LabelGrid skin =
      VoxelsFacing(outside_air, MaskWhere(air, [](uint8_t value) { return value == 0; }));
  for (size_t i = 0; i < skin.values.size(); ++i) {
    if (teeth.values[i] != 0) skin.values[i] = 0;
  }
  const FloatGrid to_teeth = DistanceMm(teeth);
  const FloatGrid to_skin = DistanceMm(skin);

  LabelGrid shell(head.hu.geometry);
  for (size_t i = 0; i < shell.values.size(); ++i) {
    if (outside_air.values[i] != 0 || depth.values[i] > reach_mm) continue;
    const bool plugs = is_air(i) && way.values[i] <= kStraight * depth.values[i] + voxel_mm / 2;
    const bool behind_teeth = to_teeth.values[i] < to_skin.values[i];
    shell.values[i] = plugs || behind_teeth ? 0 : 1;
  }
  return shell;
}

}  // namespace tissueform
