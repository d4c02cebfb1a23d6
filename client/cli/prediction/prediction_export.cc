// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/prediction_export.h"

#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/strip.h"

#include "client/cli/prediction/prediction_pictures.h"
#include "client/cli/session/resource_text.h"
#include "client/cli/shared/result_writer.h"
#include "client/cli/shared/uncertainty_results.h"
#include "client/cli/shared/uncertainty_text.h"
#include "client/cpp/plan_session.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/mesh_surfaces.h"
#include "core/planning/case_file/predicted_case.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

absl::Status OtherMesh(const v1::Prediction& prediction, const std::string& path) {
  return absl::FailedPreconditionError(
      absl::StrCat(path, " is not the mesh from which ", prediction.name(), " was made: that is ",
                   prediction.mesh(), "; name the plan that made it"));
}

// The arrays with one number per tet: what a mesh may have been uploaded with.
std::vector<CellArray> PlainArrays(const std::vector<Attribute>& cell_data) {
  std::vector<CellArray> arrays;
  for (const Attribute& attribute : cell_data) {
    if (attribute.components != 1) continue;
    const std::vector<double> values = ToDoubles(attribute);
    arrays.push_back(
        {attribute.name, Eigen::Map<const Eigen::VectorXd>(
                             values.data(), static_cast<Eigen::Index>(values.size()))});
  }
  return arrays;
}

std::string NameOf(const TetMesh& mesh, const std::vector<CellArray>& arrays) {
  return MeshName(ViewMeshPayload(mesh.positions(), mesh.tets(), arrays).Sha256());
}

OrderedJson VectorJson(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

OrderedJson PosesJson(const v1::Prediction& prediction) {
  OrderedJson poses = OrderedJson::array();
  for (const v1::HandlePose& pose : prediction.poses()) {
    poses.push_back({{"handle", pose.handle()},
                     {"rotation_vector", VectorJson(pose.rotation_vector())},
                     {"pivot_mm", VectorJson(pose.pivot_mm())},
                     {"translation_mm", VectorJson(pose.translation_mm())},
                     {"scale", pose.has_scale() ? pose.scale() : 1.0}});
  }
  return poses;
}

OrderedJson PositionsJson(const Positions& positions) {
  OrderedJson rows = OrderedJson::array();
  for (const auto& row : positions.rowwise()) {
    rows.push_back({row.x(), row.y(), row.z()});
  }
  return rows;
}

// Prediction.recipe_sha256 of what the plan makes now.
std::string RecipeSha256(const PlanProblem& problem) {
  const SessionRequest whole = SessionRequestOf(problem, "");
  SessionRequest recipe;
  recipe.stiffness = whole.stiffness;
  recipe.poisson_ratio = whole.poisson_ratio;
  recipe.fixed = whole.fixed;
  recipe.handles = whole.handles;
  recipe.contact = whole.contact;
  return RequestFingerprint(ToProto(recipe));
}

// The surfaces of a mesh beside which nothing better lies, as a case that is only looked at.
absl::StatusOr<CaseFile> CaseOfMesh(const PlanProblem& problem) {
  CaseFile contents;
  const Positions& rest = problem.mesh->positions();
  contents.mesh.vertex_count = rest.rows();
  contents.mesh.payload.assign(reinterpret_cast<const char*>(rest.data()),
                               static_cast<size_t>(rest.size()) * sizeof(double));
  const ConstraintSet sticking = StickingRegions(problem);
  std::optional<CaseSurface> skin = SkinOfMesh(*problem.mesh, sticking, {});
  if (!skin)
    return absl::InvalidArgumentError(
        "every vertex of the mesh is fixed: there is no skin to show");
  contents.surfaces = SegmentsOfMesh(*problem.mesh, sticking);
  contents.surfaces.push_back(*std::move(skin));
  for (const HandleRegion& handle : problem.constraints.handles()) {
    contents.handles.push_back({.name = handle.name, .label = handle.name});
  }
  return contents;
}

absl::Status WriteJson(const std::string& path, const OrderedJson& json) {
  return WriteFileAtomically(path, json.dump(1) + "\n");
}

}  // namespace

absl::StatusOr<PredictionMesh> ReadPlanOf(const v1::Prediction& prediction, const std::string& path,
                                          const PlanReadOptions& reading) {
  TF_ASSIGN_OR_RETURN(Plan plan, ReadPlan(path, reading));
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ResolvePlan(plan, reading.resolve));
  if (MeshNameOf(problem) != prediction.mesh()) return OtherMesh(prediction, path);
  if (problem.uncertainty && RecipeSha256(problem) != prediction.recipe_sha256()) {
    absl::FPrintF(
        stderr,
        "warning: %s has other regions, contact, stiffness or Poisson's ratio than when %s was "
        "made; its material uncertainty is omitted\n",
        path, prediction.name());
    problem.uncertainty.reset();
  }
  // Stresses are those of the model that has answered.
  TF_ASSIGN_OR_RETURN(problem.deformer.model, ToModel(prediction.model(), problem.deformer.model));
  problem.deformer.preparation.poisson_ratio = prediction.poisson_ratio();
  return PredictionMesh{std::move(plan), std::move(problem)};
}

absl::StatusOr<PredictionMesh> ReadMeshOf(const v1::Prediction& prediction,
                                          const std::string& path) {
  TF_ASSIGN_OR_RETURN(TetMeshFile file, ReadTetMesh(path));
  if (NameOf(file.mesh, {}) != prediction.mesh() &&
      NameOf(file.mesh, PlainArrays(file.cell_data)) != prediction.mesh()) {
    return OtherMesh(prediction, path);
  }
  Plan plan;
  plan.mesh_path = path;
  // Writing a result needs no regions, but a problem has one at least.
  TF_ASSIGN_OR_RETURN(ConstraintSet constraints,
                      ConstraintSet::Create(file.mesh, {}, {{"a vertex", {0}}}));
  return PredictionMesh{std::move(plan),
                        {.mesh = std::make_shared<const TetMesh>(std::move(file.mesh)),
                         .point_data = std::move(file.point_data),
                         .cell_data = std::move(file.cell_data),
                         .stiffness = {},
                         .constraints = std::move(constraints),
                         .poses = {},
                         .deformer = {},
                         .uncertainty = {}}};
}

absl::Status WriteSkin(const std::string& path, const PlanProblem& problem,
                       const Positions& deformed) {
  Positions written = deformed;
  SwapToOrFromLps(problem.written_in, &written);
  TF_ASSIGN_OR_RETURN(TriangleMesh skin,
                      TriangleMesh::Create(std::move(written), BoundaryFacets(*problem.mesh)));
  return WriteTriangleMesh(path, {std::move(skin), {}, {}});
}

OrderedJson ProvenanceJson(const v1::Prediction& prediction) {
  OrderedJson json = {{"format", "tissueform-prediction"},
                      {"version", 1},
                      {"prediction", prediction.name()},
                      {"session", prediction.session()},
                      {"mesh_sha256", absl::StripPrefix(prediction.mesh(), "meshes/")},
                      {"vertices", prediction.vertex_count()},
                      {"model", ModelText(prediction.model())},
                      {"poisson_ratio", prediction.poisson_ratio()},
                      {"recipe_sha256", prediction.recipe_sha256()},
                      {"poses", PosesJson(prediction)}};
  if (!prediction.title().empty()) json["title"] = prediction.title();
  if (!prediction.case_().empty()) json["case"] = prediction.case_();
  if (prediction.stiffness().has_uniform_pa()) {
    json["stiffness"] = {{"uniform_pa", prediction.stiffness().uniform_pa()}};
  } else {
    json["stiffness"] = {{"cell_array", prediction.stiffness().cell_array()}};
  }
  const v1::SolveSummary& summary = prediction.summary();
  json["solve"] = {{"seconds", summary.solve_seconds()},
                   {"iterations", summary.iterations()},
                   {"converged", summary.converged()},
                   {"residual", summary.residual()},
                   {"newton_steps", summary.newton_steps()},
                   {"load", summary.load()},
                   {"gave_up", TerminationName(ToSolveSummary(summary).gave_up)},
                   {"obstacle", summary.obstacle()},
                   {"second_factor_bytes", summary.second_factor_bytes()}};
  if (summary.has_contact()) {
    json["solve"]["contact"] = {{"unilateral_rows", summary.contact().row_count()},
                                {"pressing_rows", summary.contact().pressing_row_count()},
                                {"residual_mm", summary.contact().residual_mm()}};
    if (summary.contact().has_max_force_n()) {
      json["solve"]["contact"]["max_force_n"] = summary.contact().max_force_n();
    }
  }
  const v1::DeformationQuality& quality = prediction.quality();
  json["quality"] = {{"inverted_tets", quality.inverted_tet_count()},
                     {"min_volume_ratio", quality.min_volume_ratio()},
                     {"max_volume_ratio", quality.max_volume_ratio()},
                     {"total_volume_ratio", quality.total_volume_ratio()},
                     {"max_displacement_mm", quality.max_displacement_mm()}};
  json["software"] = {{"version", prediction.software_version()},
                      {"commit", prediction.software_commit()}};
  json["create_time"] = UtcTimeText(prediction.create_time());
  json["notice"] = kNotMedicalDeviceNotice;
  return json;
}

absl::Status ExportPrediction(const std::string& path, const v1::Prediction& prediction,
                              const PredictionMesh* mesh, const Positions& positions) {
  OrderedJson json = ProvenanceJson(prediction);
  const std::string ending = std::filesystem::path(path).extension();
  if (ending == ".json") {
    json["positions_mm"] = PositionsJson(positions);
    return WriteJson(path, json);
  }
  if (mesh == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " needs the mesh; name its plan (--plan) or its file (--mesh)"));
  }
  if (ending == ".vtu") {
    const std::optional<MaterialBand> band =
        FindMaterialBandOrWarn(mesh->problem, positions, /*preparation=*/nullptr);
    if (band) json["material_uncertainty"] = MaterialBandToJson(*band);
    TF_RETURN_IF_ERROR(WriteResult(path, mesh->plan, mesh->problem, positions,
                                   {.material = band ? &*band : nullptr}));
  } else if (ending == ".stl" || ending == ".ply") {
    TF_RETURN_IF_ERROR(WriteSkin(path, mesh->problem, positions));
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " must end with .vtu, .stl, .ply or .json"));
  }
  json["file"] = std::filesystem::path(path).filename().string();
  return WriteJson(path + ".json", json);
}

absl::StatusOr<CaseFile> ShownCase(const PredictionMesh* mesh, const v1::Prediction& prediction,
                                   TissueformClient* client) {
  if (mesh != nullptr) return CaseOfMesh(mesh->problem);
  if (prediction.case_().empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(prediction.name(), " has no case to draw; name its plan (--plan)"));
  }
  TF_ASSIGN_OR_RETURN(const std::string bytes, client->cases().Read(prediction.case_()));
  TF_ASSIGN_OR_RETURN(CaseFile contents, ParseCase(bytes));
  if (contents.mesh.name == prediction.mesh()) return contents;
  return absl::FailedPreconditionError(
      absl::StrCat(prediction.case_(), " has a different mesh from ", prediction.name(),
                   "; name the plan that made it (--plan)"));
}

absl::Status WritePicturesOf(const std::string& folder, const v1::Prediction& prediction,
                             const CaseFile& contents, const Positions& positions) {
  std::map<std::string, HandlePose> poses;
  for (const v1::HandlePose& pose : prediction.poses()) {
    poses[pose.handle()] = ToNamedPose(pose).pose;
  }
  TF_ASSIGN_OR_RETURN(const PredictedCase predicted, PredictCase(contents, positions, poses));
  TF_ASSIGN_OR_RETURN(const BeforeAndAfter what, BeforeAndAfterOfCase(contents, predicted, poses));
  return WriteBeforeAndAfter(what, folder);
}

}  // namespace tissueform
