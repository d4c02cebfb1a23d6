// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// All points p with (p - point_mm) . normal = 0. `normal` has length 1 and points to the side that
// is meant where one is.
struct Plane {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();

  // How far p lies on the side of the normal, in mm; negative on the other.
  double HeightMm(const Eigen::Vector3d& p) const { return normal.dot(p - point_mm); }
};

// How far a place lies on the side of all normals: the least of its heights; infinite without a
// plane.
double LeastHeightMm(const std::vector<Plane>& planes, const Eigen::Vector3d& place);

// The plane in which the mask is most like its mirror image: it minimises the mean distance (at
// most 6 mm each) of the mirrored voxels from the mask. Found by a search that halves its steps,
// from the plane x = start_x_mm, turned by up to about 16 degrees about y and z and moved by about
// 16 mm. The normal points to the patient's left.
//
// REQUIRES: the mask is not empty.
Plane FindSymmetryPlane(const LabelGrid& mask, double start_x_mm);

}  // namespace tissueform
