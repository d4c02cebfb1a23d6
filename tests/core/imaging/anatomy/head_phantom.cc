// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/core/imaging/anatomy/head_phantom.h"

#include <algorithm>
#include <cmath>

#include "core/imaging/anatomy/bone_parts.h"

namespace tissueform::testing {
namespace {

constexpr int16_t kAirHu = -1000;
constexpr int16_t kSoftHu = 40;
constexpr int16_t kBoneHu = 1100;
constexpr int16_t kSpineHu = 800;
constexpr int16_t kToothHu = 2200;

struct Voxel {
  int16_t hu = kAirHu;
  uint8_t part = 0;
  bool head = false;
};

bool InEllipsoid(const Eigen::Vector3d& p, const Eigen::Vector3d& centre,
                 const Eigen::Vector3d& semi_axes) {
  return (p - centre).cwiseQuotient(semi_axes).squaredNorm() < 1;
}

bool Within(double value, double low, double high) { return value >= low && value < high; }

// Distance, about, from the curve y = -60 + x^2 / 35 that both jaws follow.
double FromArch(const Eigen::Vector3d& p) {
  const double slope = 2 * p.x() / 35;
  return std::abs(p.y() + 60 - p.x() * p.x() / 35) / std::sqrt(1 + slope * slope);
}

bool InSoftTissue(const Eigen::Vector3d& p) {
  const bool neck = p.z() < -30 && std::hypot(p.x(), p.y() - 35) < 50;
  return neck || InEllipsoid(p, {0, 10, 35}, {75, 95, 95}) ||
         InEllipsoid(p, {0, -5, -38}, {70, 78, 72}) || InEllipsoid(p, {0, -78, 0}, {18, 18, 18});
}

bool InAir(const Eigen::Vector3d& p, const HeadPhantomOptions& options) {
  const bool nasal = std::abs(p.x()) < 10 && Within(p.y(), -50, -5) && Within(p.z(), -18, -8);
  const bool lips =
      std::abs(p.x()) < 22 && p.y() < -25 &&
      Within(p.z(), kPhantomUpperTeethMm - options.teeth_gap_mm, kPhantomUpperTeethMm);
  return nasal || lips;
}

bool InSkull(const Eigen::Vector3d& p) {
  const Eigen::Vector3d centre(0, 15, 45);
  return InEllipsoid(p, centre, {65, 80, 75}) && !InEllipsoid(p, centre, {58, 73, 68});
}

bool InUpperJaw(const Eigen::Vector3d& p) {
  const bool alveolar = std::abs(p.x()) < 30 && FromArch(p) < 7 && Within(p.z(), -32, -18);
  const bool palate = std::abs(p.x()) < 24 && Within(p.y(), -58, -12) && Within(p.z(), -22, -18);
  const bool walls =
      Within(std::abs(p.x()), 22, 30) && Within(p.y(), -45, -12) && Within(p.z(), -24, 0);
  return alveolar || palate || walls;
}

bool InLowerJaw(const Eigen::Vector3d& p, double teeth_end_mm) {
  const double side = std::abs(p.x());
  const bool body = side < 45 && FromArch(p) < 7 && Within(p.z(), -85, teeth_end_mm - 8);
  const bool ramus = Within(side, 40, 50) && Within(p.y(), -10, 16) && Within(p.z(), -75, -38);
  const bool condyle = Within(side, 40, 50) && Within(p.y(), 6, 16) && Within(p.z(), -38, -20);
  const bool coronoid = Within(side, 40, 50) && Within(p.y(), -10, -2) && Within(p.z(), -38, -28);
  return body || ramus || condyle || coronoid;
}

bool InTeeth(const Eigen::Vector3d& p, double low_mm, double high_mm) {
  return std::abs(p.x()) < 30 && FromArch(p) < 4 && Within(p.z(), low_mm, high_mm);
}

void PutJaws(const Eigen::Vector3d& p, const HeadPhantomOptions& options, Voxel* voxel) {
  const double lower_end_mm = kPhantomUpperTeethMm - options.teeth_gap_mm;
  const bool touching = options.teeth_touch && std::abs(p.x()) > 18;
  const double middle_mm = kPhantomUpperTeethMm - options.teeth_gap_mm / 2;
  if (InSkull(p) || InUpperJaw(p)) *voxel = {kBoneHu, kCranium, true};
  if (InTeeth(p, touching ? middle_mm : kPhantomUpperTeethMm, -32)) {
    *voxel = {kToothHu, kCranium, true};
  }
  if (!options.with_mandible) return;
  if (InLowerJaw(p, lower_end_mm)) *voxel = {kBoneHu, kMandible, true};
  if (InTeeth(p, lower_end_mm - 8, touching ? middle_mm : lower_end_mm)) {
    *voxel = {kToothHu, kMandible, true};
  }
}

Voxel VoxelAt(const Eigen::Vector3d& p, const HeadPhantomOptions& options) {
  Voxel voxel;
  const bool soft = InSoftTissue(p) && !InAir(p, options);
  if (options.with_soft_tissue && soft) voxel = {kSoftHu, 0, true};
  if (p.z() < -45 && std::hypot(p.x(), p.y() - 45) < 10) voxel = {kSpineHu, kSpine, true};
  PutJaws(p, options, &voxel);
  const bool cord = std::hypot(p.x() - 12, p.y() + 84) < 2.5 && p.z() < 0;
  if (options.with_cord && cord && !voxel.head) voxel.hu = kSoftHu;
  return voxel;
}

GridGeometry PhantomGeometry(const HeadPhantomOptions& options) {
  const Eigen::Vector3d low(-90, -110, options.lowest_mm);
  const Eigen::Vector3d high(90, 115, 140);
  GridGeometry geometry;
  geometry.spacing_mm = options.spacing_mm;
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    geometry.size[axis] = static_cast<int>((high[a] - low[a]) / options.spacing_mm);
  }
  // Centres at odd places, so that no solid ends exactly on one.
  geometry.origin_mm = low + Eigen::Vector3d::Constant(options.spacing_mm / 2);
  geometry.origin_mm.x() = -options.spacing_mm * (geometry.size[0] - 1) / 2.0;
  return geometry;
}

template <typename T, typename Value>
VoxelGrid<T> Filled(const HeadPhantomOptions& options, Value value) {
  VoxelGrid<T> grid(PhantomGeometry(options));
  size_t index = 0;
  for (int z = 0; z < grid.geometry.size[2]; ++z) {
    for (int y = 0; y < grid.geometry.size[1]; ++y) {
      for (int x = 0; x < grid.geometry.size[0]; ++x, ++index) {
        grid.values[index] = value(VoxelAt(grid.geometry.Centre(x, y, z), options));
      }
    }
  }
  return grid;
}

}  // namespace

HuGrid HeadPhantom(const HeadPhantomOptions& options) {
  return Filled<int16_t>(options, [](const Voxel& voxel) { return voxel.hu; });
}

LabelGrid HeadPhantomParts(const HeadPhantomOptions& options) {
  return Filled<uint8_t>(options, [](const Voxel& voxel) { return voxel.part; });
}

LabelGrid HeadPhantomMask(const HeadPhantomOptions& options) {
  return Filled<uint8_t>(options,
                         [](const Voxel& v) { return static_cast<uint8_t>(v.head ? 1 : 0); });
}

double DiceOverlap(const LabelGrid& a, const LabelGrid& b) {
  double both = 0;
  double sum = 0;
  for (size_t i = 0; i < a.values.size(); ++i) {
    both += a.values[i] != 0 && b.values[i] != 0 ? 1 : 0;
    sum += (a.values[i] != 0 ? 1 : 0) + (b.values[i] != 0 ? 1 : 0);
  }
  return sum == 0 ? 1 : 2 * both / sum;
}

LabelGrid AtPlaceOf(const GridGeometry& geometry, const LabelGrid& labels) {
  const Eigen::Vector3d first = labels.geometry.ToVoxels(geometry.origin_mm);
  LabelGrid part(geometry);
  for (int z = 0; z < geometry.size[2]; ++z) {
    for (int y = 0; y < geometry.size[1]; ++y) {
      for (int x = 0; x < geometry.size[0]; ++x) {
        part.At(x, y, z) = labels.At(x + static_cast<int>(std::lround(first.x())),
                                     y + static_cast<int>(std::lround(first.y())),
                                     z + static_cast<int>(std::lround(first.z())));
      }
    }
  }
  return part;
}

}  // namespace tissueform::testing
