// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/cases/plan_case.h"

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_replace.h"

#include "client/cpp/plan_session.h"
#include "core/base/status_macros.h"
#include "core/case_file/mesh_surfaces.h"
#include "core/mesh/skin_region.h"
#include "core/planning/model_names.h"
#include "proto/conversion/material_conversion.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

// Of each vertex of the mesh; empty where it was not made by `plan build`.
absl::StatusOr<std::vector<uint8_t>> SkinRegionOfVertex(const PlanProblem& problem) {
  std::vector<uint8_t> regions;
  if (FindAttribute(problem.point_data, "skin_region") == nullptr) return regions;
  TF_ASSIGN_OR_RETURN(const std::vector<double> values,
                      FindScalars(problem.point_data, "skin_region", "point"));
  for (const double value : values) {
    uint8_t number = 0;
    for (const SkinRegion region : kNamedSkinRegions) {
      if (value == static_cast<double>(region)) number = static_cast<uint8_t>(region);
    }
    regions.push_back(number);
  }
  return regions;
}

Vector3d MiddleOf(const std::vector<int32_t>& vertices, const Positions& positions) {
  return positions(vertices, Eigen::all).colwise().mean();
}

// A plan that turns a segment says about what; else its middle is as good as any point.
std::vector<CaseHandle> HandlesOf(const PlanProblem& problem) {
  std::vector<CaseHandle> handles;
  for (size_t h = 0; h < problem.poses.size(); ++h) {
    const HandleRegion& region = problem.constraints.handles()[h];
    const HandlePose& pose = problem.poses[h];
    const bool has_pivot = pose.rotation_vector.norm() > 0 || pose.pivot_mm.norm() > 0;
    handles.push_back({.name = region.name,
                       .label = LabelOf(region.name),
                       .pivot_mm = has_pivot ? pose.pivot_mm
                                             : MiddleOf(region.vertices, problem.mesh->positions()),
                       .pose = pose});
  }
  return handles;
}

CaseMesh MeshOf(const PlanProblem& problem) {
  const std::vector<CellArray> arrays = CellArraysOf(problem);
  const MeshPayloadView view =
      ViewMeshPayload(problem.mesh->positions(), problem.mesh->tets(), arrays);
  CaseMesh mesh{.name = MeshNameOf(problem),
                .vertex_count = view.shape.num_vertices,
                .tet_count = view.shape.num_tets,
                .cell_arrays = view.shape.cell_arrays};
  for (const absl::string_view segment : view.segments) {
    mesh.payload.append(segment.data(), segment.size());
  }
  return mesh;
}

}  // namespace

std::string LabelOf(const std::string& name) {
  constexpr std::array<std::array<const char*, 2>, 4> kKnown = {{{"mandible", "Lower jaw"},
                                                                 {"maxilla", "Upper jaw"},
                                                                 {"cheek_left", "Left cheek"},
                                                                 {"cheek_right", "Right cheek"}}};
  for (const auto& [known, label] : kKnown) {
    if (name == known) return label;
  }
  std::string label = absl::StrReplaceAll(name, {{"_", " "}});
  if (!label.empty()) label[0] = absl::ascii_toupper(static_cast<unsigned char>(label[0]));
  return label;
}

absl::StatusOr<CaseFile> CaseOfPlan(const PlanProblem& problem, CaseFile about) {
  about.mesh = MeshOf(problem);
  about.session_request = ToProto(SessionRequestOf(problem, about.mesh.name)).SerializeAsString();
  about.model = ModelName(problem.deformer.model);
  if (problem.uncertainty)
    about.material_ranges = ToProto(*problem.uncertainty).SerializeAsString();
  about.handles = HandlesOf(problem);
  TF_ASSIGN_OR_RETURN(const std::vector<uint8_t> regions, SkinRegionOfVertex(problem));
  if (!regions.empty()) {
    for (const SkinRegion region : kNamedSkinRegions) {
      const std::string name(SkinRegionName(region));
      about.skin_regions.push_back({static_cast<int>(region), name, LabelOf(name)});
    }
  }
  std::optional<CaseSurface> skin = SkinOfMesh(*problem.mesh, problem.constraints, regions);
  if (!skin) {
    return absl::InvalidArgumentError(
        "every vertex of the mesh is fixed or moved: no skin to show");
  }
  about.surfaces.push_back(*std::move(skin));
  for (CaseSurface& segment : SegmentsOfMesh(*problem.mesh, problem.constraints)) {
    about.surfaces.push_back(std::move(segment));
  }
  return about;
}

}  // namespace tissueform
