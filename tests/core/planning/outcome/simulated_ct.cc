// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/core/planning/outcome/simulated_ct.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "core/imaging/anatomy/head_segmentation.h"
#include "core/planning/plan_building/solid_voxels.h"
#include "tests/testing/metal_phantom.h"

namespace tissueform::testing {
namespace {

using Eigen::Vector3d;

constexpr double kAirHu = -1000;
constexpr double kTissueHu = 40;
constexpr double kBoneHu = 1300;
constexpr double kMarginMm = 15;

// Slices are square, as the scanner wants them; the neck ends at the lowest slice.
GridGeometry GridAround(const TriangleMesh& skin, double voxel_mm) {
  const Vector3d low = skin.positions().colwise().minCoeff();
  const Vector3d high = skin.positions().colwise().maxCoeff();
  const Vector3d middle = 0.5 * (low + high);
  const double side = (high - low).head<2>().maxCoeff() + 2 * kMarginMm;
  const int across = static_cast<int>(std::ceil(side / voxel_mm));
  const double lowest = low.z() + 2;
  const int up = static_cast<int>(std::ceil((high.z() + kMarginMm - lowest) / voxel_mm));
  const double half = 0.5 * voxel_mm * (across - 1);
  return {.size = {across, across, up},
          .origin_mm = {middle.x() - half, middle.y() - half, lowest},
          .spacing_mm = voxel_mm};
}

FloatGrid DepthIn(const TriangleMesh& surface, const GridGeometry& geometry, int threads) {
  return DistancesNearBorder(FindSolidVoxels(surface, geometry, threads).inside, surface, threads);
}

// HU at a depth in voxels: from `outside` to `inside` over one voxel, at the surface the threshold.
double Edge(double depth, double outside, double threshold, double inside) {
  return std::clamp(threshold + (inside - outside) * depth, outside, inside);
}

std::vector<int16_t> HuOf(const PostOperativeHead& head, const GridGeometry& geometry,
                          const CtSimulation& simulation, int threads) {
  const HeadSegmentationOptions thresholds;
  const FloatGrid in_skin = DepthIn(head.skin, geometry, threads);
  const FloatGrid in_bone = DepthIn(*head.bone, geometry, threads);
  std::mt19937 random(simulation.seed);
  std::normal_distribution<double> noise(0, simulation.noise_hu);
  std::vector<int16_t> hu;
  hu.reserve(in_skin.values.size());
  for (size_t i = 0; i < in_skin.values.size(); ++i) {
    const double of_skin = Edge(in_skin.values[i] / simulation.voxel_mm, kAirHu,
                                thresholds.tissue_above_hu, kTissueHu);
    const double of_bone =
        Edge(in_bone.values[i] / simulation.voxel_mm, kTissueHu, thresholds.bone_above_hu, kBoneHu);
    const double value = of_bone > kTissueHu ? of_bone : of_skin;
    hu.push_back(static_cast<int16_t>(std::lround(value + noise(random))));
  }
  return hu;
}

Vector3d NormalNear(const TriangleMesh& surface, Eigen::Index vertex) {
  Vector3d normal = Vector3d::Zero();
  for (const auto& triangle : surface.triangles().rowwise()) {
    if ((triangle.array() != static_cast<int32_t>(vertex)).all()) continue;
    const Vector3d a = surface.positions().row(triangle[0]);
    const Vector3d b = surface.positions().row(triangle[1]);
    const Vector3d c = surface.positions().row(triangle[2]);
    normal += (b - a).cross(c - a);
  }
  return normal.normalized();
}

void AddPlate(const TriangleMesh& bone, const Vector3d& near_mm, std::vector<MetalPart>* parts) {
  Eigen::Index nearest = 0;
  (bone.positions().rowwise() - near_mm.transpose()).rowwise().squaredNorm().minCoeff(&nearest);
  const Vector3d place = bone.positions().row(nearest);
  const Vector3d out = NormalNear(bone, nearest);
  const Vector3d along = Vector3d::UnitZ().cross(out).normalized();
  MetalPart part;
  part.axes << out, along, out.cross(along);
  part.centre_mm = place + 0.5 * out;
  part.half_mm = {0.5, 12, 2};
  parts->push_back(part);
  for (const double side : {-9.0, 9.0}) {
    part.centre_mm = place + side * along - 2 * out;
    part.half_mm = {3, 1, 1};
    parts->push_back(part);
  }
}

}  // namespace

CtVolume ScanOf(const PostOperativeHead& head, const CtSimulation& simulation, int threads) {
  const GridGeometry geometry = GridAround(head.skin, simulation.voxel_mm);
  CtVolume volume;
  volume.size = geometry.size;
  volume.spacing_mm = Vector3d::Constant(geometry.spacing_mm);
  volume.origin_mm = geometry.origin_mm;
  volume.hu = HuOf(head, geometry, simulation, threads);
  MetalWork work;
  for (const Vector3d& plate : simulation.plates_mm) AddPlate(*head.bone, plate, &work.parts);
  ScanWithMetal(work, threads, &volume);
  return volume;
}

}  // namespace tissueform::testing
