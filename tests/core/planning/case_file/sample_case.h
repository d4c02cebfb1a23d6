// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/str_cat.h"

#include "core/mesh/payload/mesh_payload.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/case_file/mesh_surfaces.h"
#include "tests/testing/meshes.h"

namespace tissueform {

// A case of a small bar with everything that a case may hold.
inline CaseFile SampleCase() {
  const TetMesh bar = testing::Bar({2, 2, 4}, 10);
  const ConstraintSet constraints = testing::BarEnds(bar);
  const std::vector<CellArray> arrays = {{"stiffness", Eigen::VectorXd::Ones(bar.num_tets())}};
  const MeshPayloadView view = ViewMeshPayload(bar.positions(), bar.tets(), arrays);
  CaseFile contents;
  contents.title = "Upper end";
  contents.software = "tissueform 0.1.0";
  contents.commit = "0123abc";
  contents.created = "2026-11-23T13:00:00Z";
  contents.plan_sha256 = std::string(64, 'a');
  contents.mesh = {.name = absl::StrCat("meshes/", view.Sha256()),
                   .vertex_count = view.shape.num_vertices,
                   .tet_count = view.shape.num_tets,
                   .cell_arrays = view.shape.cell_arrays};
  for (const absl::string_view segment : view.segments) {
    contents.mesh.payload.append(segment.data(), segment.size());
  }
  contents.session_request = "a request";
  contents.model = "neo_hookean";
  contents.material_ranges = "ranges";
  contents.surfaces.push_back(
      *SkinOfMesh(bar, constraints, std::vector<uint8_t>(size_t(bar.num_vertices()), 3)));
  contents.surfaces.push_back(SegmentsOfMesh(bar, constraints).front());
  contents.skin_regions = {{3, "chin", "Chin"}};
  contents.handles = {{.name = "top",
                       .label = "Upper end",
                       .pivot_mm = {1, 2, 3},
                       .pose = {.rotation_vector = {0.1, 0, 0},
                                .pivot_mm = {4, 5, 6},
                                .translation_mm = {0, -6, 0},
                                .scale = 1},
                       .most_translation_mm = 12,
                       .most_rotation_deg = 9}};
  contents.landmarks = {
      {.name = "pogonion", .label = "Pogonion", .position_mm = {1, 1, 1}, .handle = "top"},
      {.name = "pronasale", .label = "Nose tip", .position_mm = {2, 2, 2}, .skin_vertex = 5}};
  contents.head_frame.origin_mm = {1, 2, 3};
  contents.head_frame.source = "recipe";
  return contents;
}

}  // namespace tissueform
