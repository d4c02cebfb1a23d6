// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// Values between the voxels of a volume whose slices lie unevenly or beside each other
// (CtVolume::slice_origins_mm): linear in each of the two slices about a place, and along the
// normal between them. At a slice it is that slice; a linear function of position is reproduced.
// Refers to the volume.
class UnevenSlices {
 public:
  explicit UnevenSlices(const CtVolume& volume);

  // None outside: beyond half a voxel beside the outermost centres, or half of the first or last
  // gap.
  std::optional<double> ValueAt(const Eigen::Vector3d& place_mm) const;

  // Of all voxels, upright in the patient.
  Eigen::AlignedBox3d Box() const;

  double smallest_gap_mm() const;

 private:
  double HeightOf(const Eigen::Vector3d& place_mm) const { return normal_.dot(place_mm); }
  // In voxels of slice k, from its first.
  Eigen::Vector2d InSlice(const Eigen::Vector3d& place_mm, size_t k) const;
  double ValueIn(size_t k, const Eigen::Vector2d& at) const;

  const CtVolume& volume_;
  Eigen::Vector3d normal_;
  std::vector<double> heights_;  // of the slices, rising
};

}  // namespace tissueform
