// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// A piece of metal that hangs together: a filling, a crown, a bracket, or brackets with their wire.
struct MetalCluster {
  double volume_mm3 = 0;
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();  // DICOM LPS
  double low_z_mm = 0;                                  // of its voxels' centres
  double high_z_mm = 0;
  int16_t top_hu = 0;
};

// The metal of a CT, voxel by voxel of the volume as it was read.
struct MetalFindings {
  std::vector<uint8_t> mask;           // as CtVolume::hu; empty where there is no metal
  std::vector<MetalCluster> clusters;  // by falling volume
  double threshold_hu = 0;             // that a voxel of metal exceeds, dead ones apart

  bool any() const { return !clusters.empty(); }
};

// Finds metal: clusters above 2500 HU of which one of these holds, each of which sets metal apart
// from enamel, the densest there is in a head (2000 to 3000 HU):
//   * a voxel is above 3300 HU;
//   * at least 4 voxels have the volume's highest value, and that is above 3000 HU: the scanner's
//     scale ends there (3071 on 12 bits);
//   * a voxel is above 3000 HU, and soft tissue round the cluster is at least twice as rough as
//     elsewhere in the volume: streaks.
// Voxels that metal encloses in their slice and that are less dense (dead ones, where the scanner
// found no light at all) count as metal. With `threshold_hu`, every cluster above that is metal.
MetalFindings FindMetal(const CtVolume& volume, std::optional<double> threshold_hu = std::nullopt);

}  // namespace tissueform
