// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_mesh.h"

#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/case_file/case_reader.h"
#include "core/planning/stiffness.h"

namespace tissueform {

absl::StatusOr<TetMeshFile> ReadMeshOfCase(const std::string& path) {
  const absl::StatusOr<CaseFile> contents = ReadCase(path);
  if (absl::IsNotFound(contents.status())) {
    return absl::NotFoundError(absl::StrCat(
        contents.status().message(), "; save it there from the planner (Case file), or copy it"));
  }
  TF_RETURN_IF_ERROR(contents.status());
  const CaseMesh& mesh = contents->mesh;
  MeshPayload payload({mesh.vertex_count, mesh.tet_count, mesh.cell_arrays});
  payload.Write(0, mesh.payload);
  std::vector<Attribute> cell_data;
  for (const CellArray& array : payload.cell_arrays()) {
    cell_data.push_back(
        {array.name, 1, std::vector<double>(array.values.begin(), array.values.end())});
  }
  absl::StatusOr<TetMesh> tets =
      TetMesh::Create(std::move(payload.positions()), std::move(payload.tets()));
  if (!tets.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("mesh ", path, ": ", tets.status().message()));
  }
  return TetMeshFile{.mesh = *std::move(tets), .point_data = {}, .cell_data = std::move(cell_data)};
}

// A server names a mesh by its vertices, its tets and the array that holds their stiffness.
absl::Status CheckMeshDigest(const Plan& plan, const TetMeshFile& file) {
  if (plan.mesh_sha256.empty()) return absl::OkStatus();
  std::vector<CellArray> arrays;
  if (const auto* chosen = std::get_if<StiffnessFromCellData>(&plan.stiffness)) {
    TF_ASSIGN_OR_RETURN(Eigen::VectorXd stiffness,
                        ResolveStiffness(plan.stiffness, file.mesh.num_tets(), file.cell_data));
    arrays.push_back({chosen->name, std::move(stiffness)});
  }
  Positions positions = file.mesh.positions();
  SwapToOrFromLps(plan.coordinate_system, &positions);
  const MeshPayloadView view = ViewMeshPayload(positions, file.mesh.tets(), arrays);
  if (view.Sha256() == plan.mesh_sha256) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("mesh ", plan.mesh_path,
                   ": not the plan's mesh (mesh_sha256); save the case from which "
                   "the plan was exported under that name"));
}

}  // namespace tissueform
