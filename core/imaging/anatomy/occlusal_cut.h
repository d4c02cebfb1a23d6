// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>

#include <Eigen/Core>

#include "core/imaging/anatomy/plane.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// Where teeth may lie: a box in the patient's axes, mm.
struct DentalBox {
  Eigen::Vector3d low_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d high_mm = Eigen::Vector3d::Zero();

  bool Contains(const Eigen::Vector3d& p) const {
    return (p.array() >= low_mm.array()).all() && (p.array() <= high_mm.array()).all();
  }
};

// The plane between the upper and the lower teeth, normal toward the head.
struct OcclusalCut {
  Plane plane;
  // 1 - (bone and tooth that the plane goes through) / (the least on its two sides, within 8 mm),
  // per mm: 1 where the plane meets nothing, 0 where it goes through as much as lies beside it.
  double clearance = 0;
};

// The plane with the best clearance among those that have teeth (above 1300 HU) on both sides:
// pitched by up to 24 and rolled by up to 8 degrees. Nothing when the box holds no teeth, or those
// of one jaw only.
std::optional<OcclusalCut> FindOcclusalCut(const HuGrid& hu, const DentalBox& box);

// How clear that plane is, however it was found.
OcclusalCut MeasureOcclusalCut(const HuGrid& hu, const DentalBox& box, const Plane& plane);

}  // namespace tissueform
