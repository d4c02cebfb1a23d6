// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/planning/case_file/viewer_file.h"
#include "core/planning/json_values.h"
#include "core/planning/model_names.h"
#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_building/viewer_landmarks.h"
#include "core/planning/plan_io.h"
#include "core/planning/plan_schema.h"
#include "core/planning/planned_contact.h"
#include "core/planning/tissue_ranges.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

constexpr char kMeshFile[] = "head.vtu";
constexpr char kAnatomyArray[] = "anatomy";
constexpr char kStiffnessArray[] = "youngs_modulus_pa";

Json Equals(size_t label) { return {{"point_data", kAnatomyArray}, {"equals", label}}; }

// How far the tissues are known, where the table says it: by their places in it.
std::optional<FactorByCellData> FactorsOf(const StiffnessTable& table) {
  if (table.front().factor_95 == 0) return std::nullopt;
  FactorByCellData factors{.name = kTissueArray, .factor_of_value = {}};
  for (size_t t = 0; t < table.size(); ++t) {
    factors.factor_of_value.emplace_back(static_cast<int64_t>(t), table[t].factor_95);
  }
  return factors;
}

Json UncertaintyJson(const FactorByCellData& factors) {
  Json values = Json::object();
  for (const auto& [value, factor] : factors.factor_of_value) {
    values[std::to_string(value)] = factor;
  }
  return {{"youngs_modulus_factor_95", {{"by_cell_data", factors.name}, {"values", values}}}};
}

std::string PlanJson(const PlanBuild& build) {
  Json plan = {{"format", "tissueform-plan"},
               {"unit", "mm"},
               {"coordinate_system", "LPS"},
               {"mesh", kMeshFile},
               {"stiffness", {{"cell_data", kStiffnessArray}}},
               {"poisson_ratio", build.recipe.poisson_ratio},
               {"fixed", Equals(kFixedBone)},
               {"model", ModelName(build.recipe.model)}};
  for (size_t s = 0; s < build.segments.size(); ++s) {
    plan["handles"].push_back({{"name", build.segments[s].cut.name},
                               {"region", Equals(kFirstSegment + s)},
                               {"pose", ToJson(build.segments[s].pose)}});
  }
  if (const auto factors = FactorsOf(build.recipe.tissues)) {
    plan["uncertainty"] = UncertaintyJson(*factors);
  }
  if (build.lips) {
    plan["contact"] =
        ContactToJson(build.lips->rows, NamesOf(build.segments), CoordinateSystem::kLps);
    if (!build.lips->edge.pairs.empty()) {
      plan["contact"]["seal"] = LipEdgeToJson(build.lips->edge, CoordinateSystem::kLps);
    }
  }
  plan["version"] = LowestPlanVersion(plan);
  return plan.dump(2) + "\n";
}

VertexSelector SelectLabel(size_t label) {
  return {SelectByPointData{kAnatomyArray, static_cast<double>(label)}};
}

// PlanJson, read.
Plan PlanOf(const PlanBuild& build) {
  Plan plan;
  plan.mesh_path = kMeshFile;
  plan.stiffness = StiffnessFromCellData{kStiffnessArray};
  plan.poisson_ratio = build.recipe.poisson_ratio;
  plan.fixed = SelectLabel(kFixedBone);
  for (size_t s = 0; s < build.segments.size(); ++s) {
    // A plan says degrees. Radians do not come back from them to the last bit, so that the pose
    // goes through the words of the plan here, too.
    plan.handles.push_back({.name = build.segments[s].cut.name,
                            .region = SelectLabel(kFirstSegment + s),
                            .pose = PoseFromJson(ToJson(build.segments[s].pose))});
  }
  if (build.lips) {
    // As with poses: what is read back.
    plan.contact = ContactFromJson(
        ContactToJson(build.lips->rows, NamesOf(build.segments), CoordinateSystem::kLps));
    if (!build.lips->edge.pairs.empty()) plan.lip_edge = build.lips->edge;
  }
  plan.model = build.recipe.model;
  if (const auto factors = FactorsOf(build.recipe.tissues)) {
    plan.uncertainty.emplace().youngs_modulus_factor_95 = *factors;
  }
  return plan;
}

TetMeshFile MeshFile(const PlanBuild& build) {
  const TetStiffness& stiffness = build.stiffness;
  std::vector<Attribute> of_points = {{kAnatomyArray, 1, build.regions.anatomy},
                                      {"skin_region", 1, build.regions.skin_region}};
  if (build.lips) of_points.push_back({kContactArray, 1, build.lips->contact});
  return {.mesh = build.mesh.mesh,
          .point_data = std::move(of_points),
          .cell_data = {{"mean_hu", 1, stiffness.mean_hu},
                        {"voxels", 1, stiffness.voxels},
                        {kTissueArray, 1, stiffness.tissue},
                        {kStiffnessArray, 1, stiffness.youngs_modulus_pa}}};
}

absl::Status WriteSegments(const PlanBuild& build, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directory(folder, error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot create the folder ", folder.string(), ": ", error.message()));
  }
  for (const BuiltSegment& segment : build.segments) {
    TF_RETURN_IF_ERROR(
        WriteTriangleMesh((folder / (segment.cut.name + ".stl")).string(),
                          {.mesh = segment.surface, .point_data = {}, .cell_data = {}}));
  }
  return absl::OkStatus();
}

// It says which mesh file it belongs to, by what has been written of that.
absl::Status WriteViewer(const PlanBuild& build, const std::filesystem::path& folder) {
  TF_ASSIGN_OR_RETURN(const std::string mesh_sha256, MeshFileSha256((folder / kMeshFile).string()));
  const std::vector<std::string> segments = NamesOf(build.segments);
  TF_ASSIGN_OR_RETURN(
      const std::string bytes,
      SerializeViewer({.mesh_file_sha256 = mesh_sha256,
                       .surfaces = build.viewer_surfaces,
                       .landmarks = MakeViewerLandmarks(build.landmarks, build.frankfort,
                                                        build.bone, build.parts.labels, segments,
                                                        build.viewer_surfaces.front()),
                       .head_frame = build.head_frame}));
  return WriteFileAtomically((folder / kViewerFile).string(), bytes);
}

}  // namespace

absl::Status WritePlan(const PlanBuild& build, const std::string& folder) {
  const std::filesystem::path root = folder;
  TF_RETURN_IF_ERROR(WriteTetMesh((root / kMeshFile).string(), MeshFile(build)));
  TF_RETURN_IF_ERROR(WriteSegments(build, root / "segments"));
  TF_RETURN_IF_ERROR(WriteViewer(build, root));
  return WriteFileAtomically((root / "plan.json").string(), PlanJson(build));
}

absl::StatusOr<PlanProblem> ToPlanProblem(const PlanBuild& build) {
  return ResolvePlan(PlanOf(build), MeshFile(build));
}

}  // namespace tissueform
