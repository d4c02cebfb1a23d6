// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/crown_finder.h"

#include <algorithm>
#include <cmath>

#include "core/imaging/anatomy/bone_parts.h"
#include "core/mesh/surface_cut.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

// A crown stands so far out of the gum, from its tip; and the teeth's planes lie so deep below the
// highest tips.
constexpr double kCrownMm = 8.5;
constexpr double kOverCrownMm = 5;
constexpr double kArchHalfWidthMm = 33;
constexpr double kBehindLastToothMm = 2;
constexpr double kBeforeIncisorMm = 12;

template <typename Height>
Eigen::VectorXd HeightsOf(const TriangleMesh& surface, const Height& height) {
  Eigen::VectorXd heights(surface.num_vertices());
  for (Index v = 0; v < heights.size(); ++v) {
    heights[v] = height(surface.positions().row(v).transpose());
  }
  return heights;
}

}  // namespace

BonePart CrownFinder::operator()(const Vector3d& place) const {
  const uint8_t part = PartAt(place);
  if (part == kCranium && UpperHeight(place) > 0) return kUpperTeeth;
  if (part == kMandible && LowerHeight(place) > 0) return kLowerTeeth;
  return kPlainBone;
}

TriangleMesh CrownFinder::Cut(const TriangleMesh& surface) const {
  const TriangleMesh once = CutWhereZero(
      surface, HeightsOf(surface, [this](const Vector3d& p) { return UpperHeight(p); }));
  return CutWhereZero(once, HeightsOf(once, [this](const Vector3d& p) { return LowerHeight(p); }));
}

double CrownFinder::UpperHeight(const Vector3d& place) const {
  return CrownHeight(place, landmarks_.upper_teeth, landmarks_.upper_incisor, -1);
}

double CrownFinder::LowerHeight(const Vector3d& place) const {
  return CrownHeight(place, landmarks_.lower_teeth, landmarks_.lower_incisor, 1);
}

double CrownFinder::CrownHeight(const Vector3d& place, const Plane& teeth, const Vector3d& incisor,
                                double tips_up) const {
  const Landmarks& l = landmarks_;
  const double over = tips_up * teeth.HeightMm(place);
  const double behind = -l.ForwardOf(teeth).dot(place - incisor);
  const double last = -std::min(l.ForwardOf(teeth).dot(l.last_upper_tooth.left - incisor),
                                l.ForwardOf(teeth).dot(l.last_upper_tooth.right - incisor));
  return std::min({over + kCrownMm, kOverCrownMm - over, behind + kBeforeIncisorMm,
                   last + kBehindLastToothMm - behind,
                   kArchHalfWidthMm - std::abs(l.midsagittal.HeightMm(place))});
}

uint8_t CrownFinder::PartAt(const Vector3d& place) const {
  const VoxelCell cell(parts_.geometry.ToVoxels(place), parts_.geometry.size);
  uint8_t best = 0;
  double most = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const auto [x, y, z] = cell.Corner(corner);
    const uint8_t part = parts_.At(x, y, z);
    if (bone_.At(x, y, z) != label_ || cell.Weight(corner) <= most) continue;
    best = part;
    most = cell.Weight(corner);
  }
  return best;
}

}  // namespace tissueform
