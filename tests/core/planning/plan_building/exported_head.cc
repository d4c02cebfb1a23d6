// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/core/planning/plan_building/exported_head.h"

#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/surface_extraction.h"
#include "core/mesh/io/triangle_mesh_io.h"

namespace tissueform::testing {
namespace {

absl::StatusOr<TriangleMesh> SkinOf(const HuGrid& hu, double neck_mm) {
  FloatGrid values(hu.geometry);
  std::copy(hu.values.begin(), hu.values.end(), values.values.begin());
  TF_ASSIGN_OR_RETURN(const TriangleMesh closed,
                      ExtractSurface(values, {.level = -500, .clearance = 20}));
  std::vector<Eigen::RowVector3i> kept;
  for (const auto& t : closed.triangles().rowwise()) {
    const bool neck = closed.positions()(t[0], 2) < hu.geometry.origin_mm.z() + neck_mm;
    if (!neck) kept.emplace_back(t);
  }
  TriangleIndices triangles(static_cast<Eigen::Index>(kept.size()), 3);
  for (size_t f = 0; f < kept.size(); ++f) triangles.row(static_cast<Eigen::Index>(f)) = kept[f];
  return TriangleMesh::Create(closed.positions(), std::move(triangles));
}

absl::StatusOr<TriangleMesh> BoneOf(const LabelGrid& parts, std::vector<uint8_t> labels) {
  const LabelGrid mask = MaskWhere(parts, [&](uint8_t part) {
    return std::find(labels.begin(), labels.end(), part) != labels.end();
  });
  return ExtractSurface(GaussianSmooth(SignedDistanceMm(mask), 0.7 * parts.geometry.spacing_mm));
}

}  // namespace

absl::StatusOr<ExportedHead> ExportHead(const HuGrid& hu, const LabelGrid& parts, double neck_mm) {
  TF_ASSIGN_OR_RETURN(TriangleMesh skin, SkinOf(hu, neck_mm));
  TF_ASSIGN_OR_RETURN(TriangleMesh skull, BoneOf(parts, {kCranium, kSpine}));
  TF_ASSIGN_OR_RETURN(TriangleMesh lower_jaw, BoneOf(parts, {kMandible}));
  return ExportedHead{std::move(skin), std::move(skull), std::move(lower_jaw)};
}

absl::Status WriteHead(const ExportedHead& head, const std::string& folder) {
  for (const auto& [name, mesh] :
       {std::pair("skin", head.skin), {"skull", head.skull}, {"lower_jaw", head.lower_jaw}}) {
    TF_RETURN_IF_ERROR(WriteTriangleMesh(folder + "/" + name + ".stl",
                                         {.mesh = mesh, .point_data = {}, .cell_data = {}}));
  }
  return absl::OkStatus();
}

TriangleMesh Transformed(const TriangleMesh& mesh, const Eigen::Matrix3d& linear) {
  return *TriangleMesh::Create(mesh.positions() * linear.transpose(), mesh.triangles());
}

}  // namespace tissueform::testing
