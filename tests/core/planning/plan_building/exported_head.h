// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/ct/voxel_grid.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform::testing {

struct ExportedHead {
  TriangleMesh skin;  // open at the neck
  TriangleMesh skull;
  TriangleMesh lower_jaw;
};

// What a program for segmentation exports of a head: the level set of the CT at -500 HU without
// what lies lower than `neck_mm` over the grid's lower border, and smoothed surfaces of the parts
// (numbers of bone_parts.h; the spine belongs to the skull).
absl::StatusOr<ExportedHead> ExportHead(const HuGrid& hu, const LabelGrid& parts, double neck_mm);

// Writes skin.stl, skull.stl and lower_jaw.stl into a folder.
absl::Status WriteHead(const ExportedHead& head, const std::string& folder);

// As it is in another file: turned, scaled, moved.
TriangleMesh Transformed(const TriangleMesh& mesh, const Eigen::Matrix3d& linear);

}  // namespace tissueform::testing
