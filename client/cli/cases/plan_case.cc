// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/cases/plan_case.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_replace.h"

#include "client/cpp/plan_session.h"
#include "core/base/status_macros.h"
#include "core/mesh/skin_region.h"
#include "core/planning/case_file/mesh_surfaces.h"
#include "core/planning/case_file/parted_skin.h"
#include "core/planning/case_file/skin_follow.h"
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
  regions.reserve(values.size());
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

bool HasHandle(const PlanProblem& problem, const std::string& name) {
  const std::vector<HandleRegion>& handles = problem.constraints.handles();
  return std::any_of(handles.begin(), handles.end(),
                     [&](const HandleRegion& handle) { return handle.name == name; });
}

// A plan that turns a segment says about what. Else planners turn jaws about their front teeth and
// a chin about its front; without such a landmark the middle is as good as any point.
Vector3d PivotOf(const PlanProblem& problem, size_t handle,
                 const std::vector<CaseLandmark>& landmarks) {
  const HandleRegion& region = problem.constraints.handles()[handle];
  const HandlePose& pose = problem.poses[handle];
  if (pose.rotation_vector.norm() > 0 || pose.pivot_mm.norm() > 0) return pose.pivot_mm;
  for (const char* name : {"upper_incisor", "lower_incisor", "pogonion"}) {
    for (const CaseLandmark& landmark : landmarks) {
      if (landmark.name == name && landmark.handle == region.name) return landmark.position_mm;
    }
  }
  return MiddleOf(region.vertices, problem.mesh->positions());
}

std::vector<CaseHandle> HandlesOf(const PlanProblem& problem,
                                  const std::vector<CaseLandmark>& landmarks) {
  std::vector<CaseHandle> handles;
  handles.reserve(problem.poses.size());
  for (size_t h = 0; h < problem.poses.size(); ++h) {
    const std::string& name = problem.constraints.handles()[h].name;
    handles.push_back({.name = name,
                       .label = LabelOf(name),
                       .pivot_mm = PivotOf(problem, h, landmarks),
                       .pose = problem.poses[h]});
  }
  return handles;
}

// What moves with a segment that is no handle of this plan (a plan is a text, and may be edited)
// stays.
std::vector<CaseSurface> FollowingSurfaces(const PlanProblem& problem,
                                           std::vector<CaseSurface> surfaces,
                                           const std::vector<uint8_t>& regions) {
  for (CaseSurface& surface : surfaces) {
    if (!HasHandle(problem, surface.handle)) {
      surface.handle.clear();
      if (surface.kind == SurfaceKind::kSegment) surface.kind = SurfaceKind::kBone;
    }
    if (surface.kind != SurfaceKind::kSkin) continue;
    surface.follows =
        FollowSkin(surface.positions, surface.triangles, *problem.mesh, StickingRegions(problem));
    PartSkin(*problem.mesh, StickingRegions(problem), problem.constraints.contact(), &surface);
    surface.regions = RegionsOfFollowers(*surface.follows, regions);
  }
  if (std::optional<CaseSurface> lips =
          InsidesOfLips(*problem.mesh, StickingRegions(problem), problem.constraints.contact())) {
    surfaces.push_back(*std::move(lips));
  }
  return surfaces;
}

std::vector<CaseLandmark> KnownLandmarks(const PlanProblem& problem,
                                         std::vector<CaseLandmark> landmarks) {
  for (CaseLandmark& landmark : landmarks) {
    if (!HasHandle(problem, landmark.handle)) landmark.handle.clear();
  }
  return landmarks;
}

absl::StatusOr<std::vector<CaseSurface>> SurfacesOfMesh(const PlanProblem& problem,
                                                        const std::vector<uint8_t>& regions) {
  const ConstraintSet sticking = StickingRegions(problem);
  std::optional<CaseSurface> skin = SkinOfMesh(*problem.mesh, sticking, regions);
  if (!skin) {
    return absl::InvalidArgumentError(
        "every vertex of the mesh is fixed or moved: there is no skin to show");
  }
  std::vector<CaseSurface> surfaces = {*std::move(skin)};
  for (CaseSurface& segment : SegmentsOfMesh(*problem.mesh, sticking)) {
    surfaces.push_back(std::move(segment));
  }
  return surfaces;
}

std::optional<CaseContact> ContactOf(const PlanProblem& problem) {
  if (problem.constraints.contact().empty()) return std::nullopt;
  CaseContact contact{.rows = static_cast<int64_t>(problem.constraints.contact().size()),
                      .sticking = {}};
  contact.sticking.resize(static_cast<Eigen::Index>(problem.freed.size()), 2);
  for (size_t i = 0; i < problem.freed.size(); ++i) {
    contact.sticking.row(static_cast<Eigen::Index>(i)) << problem.freed[i].vertex,
        problem.freed[i].region;
  }
  return contact;
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

absl::StatusOr<CaseFile> CaseOfPlan(const PlanProblem& problem, CaseFile about,
                                    std::optional<ViewerFile> viewer) {
  about.mesh = MeshOf(problem);
  about.session_request = ToProto(SessionRequestOf(problem, about.mesh.name)).SerializeAsString();
  about.model = ModelName(problem.deformer.model);
  about.contact = ContactOf(problem);
  if (problem.uncertainty) {
    about.material_ranges = ToProto(*problem.uncertainty).SerializeAsString();
  }
  TF_ASSIGN_OR_RETURN(const std::vector<uint8_t> regions, SkinRegionOfVertex(problem));
  if (!regions.empty()) {
    for (const SkinRegion region : kNamedSkinRegions) {
      const std::string name(SkinRegionName(region));
      about.skin_regions.push_back({static_cast<int>(region), name, LabelOf(name)});
    }
  }
  if (viewer) {
    about.surfaces = FollowingSurfaces(problem, std::move(viewer->surfaces), regions);
    about.landmarks = KnownLandmarks(problem, std::move(viewer->landmarks));
    about.head_frame = viewer->head_frame;
  } else {
    TF_ASSIGN_OR_RETURN(about.surfaces, SurfacesOfMesh(problem, regions));
  }
  about.handles = HandlesOf(problem, about.landmarks);
  return about;
}

}  // namespace tissueform
