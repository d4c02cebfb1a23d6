// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/compare/compare_models.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/report_parts.h"
#include "client/cli/shared/result_writer.h"
#include "client/cli/shared/stage_progress.h"
#include "client/cli/shared/uncertainty_results.h"
#include "client/cli/shared/uncertainty_text.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/model_names.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

// What one model made of the plan.
struct ModelResult {
  std::string model;
  Deformation deformation;
  DeformationQuality quality;
  double prepare_seconds = 0;  // what the models before it had not prepared yet
  double solve_seconds = 0;
  std::optional<MaterialBand> band;        // of elastic models, where the plan has ranges
  std::vector<RegionDistances> distances;  // to the reference
};

struct ModelComparison {
  Plan plan;
  PlanProblem problem;
  std::vector<ModelResult> results;
};

// The chosen models, the reference among them, in the order of the format.
std::vector<std::string> ModelsToRun(const CompareOptions& options) {
  std::vector<std::string> models;
  for (const std::string& name : KnownModelNames()) {
    const bool is_chosen =
        options.models.empty() ||
        std::find(options.models.begin(), options.models.end(), name) != options.models.end();
    if (is_chosen || name == options.reference) models.push_back(name);
  }
  return models;
}

std::string ResultPath(const CompareOptions& options, const std::string& model) {
  return absl::StrCat(options.out, "/", model, ".vtu");
}

// Asked before the work.
absl::Status CheckOutputs(const CompareOptions& options, const std::vector<std::string>& models) {
  if (!options.csv.empty()) TF_RETURN_IF_ERROR(CheckWritable(options.csv));
  if (options.out.empty()) return absl::OkStatus();
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot create the folder ", options.out, ": ", error.message()));
  }
  for (const std::string& model : models) {
    TF_RETURN_IF_ERROR(CheckWritable(ResultPath(options, model)));
  }
  return absl::OkStatus();
}

absl::Status Predict(const PlanProblem& problem,
                     const std::shared_ptr<MeshPreparation>& preparation, int solver_threads,
                     ModelResult* result) {
  const StageProgress progress("predicting by " + result->model);
  Stopwatch stopwatch;
  std::unique_ptr<Deformer> deformer;
  {
    const BlasThreadsScope factorising(solver_threads);  // as deform does
    TF_ASSIGN_OR_RETURN(deformer, CreateDeformer(preparation, problem.deformer));
  }
  result->prepare_seconds = stopwatch.Restart();
  TF_ASSIGN_OR_RETURN(result->deformation, deformer->Deform(problem.poses));
  result->solve_seconds = stopwatch.Seconds();
  return absl::OkStatus();
}

absl::StatusOr<ModelResult> RunModel(const std::string& name, PlanProblem problem,
                                     const std::shared_ptr<MeshPreparation>& preparation,
                                     int solver_threads) {
  ModelResult result;
  result.model = name;
  TF_ASSIGN_OR_RETURN(problem.deformer.model, ModelFromName(name));
  problem.deformer.neo_hookean.newton_blas_threads = solver_threads;
  TF_RETURN_IF_ERROR(Predict(problem, preparation, solver_threads, &result));
  result.quality = MeasureDeformation(*problem.mesh, result.deformation.positions);
  result.band = FindMaterialBandOrWarn(problem, result.deformation.positions, preparation);
  return result;
}

std::vector<ComparedRegion> PlanRegions(const PlanProblem& problem) {
  const ConstraintSet& constraints = problem.constraints;
  std::vector<ComparedRegion> regions = WholeAndSkin(*problem.mesh);
  regions.push_back({"fixed", constraints.fixed()});
  for (const HandleRegion& handle : constraints.handles()) {
    regions.push_back({"handle " + handle.name, handle.vertices});
  }
  ComparedRegion free{"free", {}};
  std::set_difference(regions[0].vertices.begin(), regions[0].vertices.end(),
                      constraints.constrained().begin(), constraints.constrained().end(),
                      std::back_inserter(free.vertices));
  regions.push_back(std::move(free));
  return regions;
}

const Positions& ReferenceOf(const CompareOptions& options, const ModelComparison& comparison) {
  return std::find_if(comparison.results.begin(), comparison.results.end(),
                      [&](const ModelResult& result) { return result.model == options.reference; })
      ->deformation.positions;
}

absl::Status MeasureDistances(const CompareOptions& options, ModelComparison* comparison) {
  const std::vector<ComparedRegion> regions = PlanRegions(comparison->problem);
  const Positions& reference = ReferenceOf(options, *comparison);
  for (ModelResult& result : comparison->results) {
    TF_ASSIGN_OR_RETURN(const Eigen::VectorXd distances,
                        VertexDistances(reference, result.deformation.positions));
    result.distances = DistancesByRegion(distances, regions);
  }
  return absl::OkStatus();
}

absl::StatusOr<ModelComparison> RunModels(const CompareOptions& options,
                                          const std::vector<std::string>& models) {
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(options.a, options.reading));
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ResolvePlan(plan, options.reading.resolve));
  problem.deformer.preparation.threads = options.threads;
  TF_ASSIGN_OR_RETURN(const auto preparation,
                      MeshPreparation::Create(*problem.mesh, problem.stiffness, problem.constraints,
                                              problem.deformer.preparation));
  ModelComparison comparison{plan, std::move(problem), {}};
  for (const std::string& model : models) {
    TF_ASSIGN_OR_RETURN(ModelResult result,
                        RunModel(model, comparison.problem, preparation, options.solver_threads));
    comparison.results.push_back(std::move(result));
  }
  TF_RETURN_IF_ERROR(MeasureDistances(options, &comparison));
  return comparison;
}

absl::Status WriteResults(const CompareOptions& options, const ModelComparison& comparison) {
  if (options.out.empty()) return absl::OkStatus();
  const PlanProblem& problem = comparison.problem;
  Positions reference = ReferenceOf(options, comparison);
  SwapToOrFromLps(problem.written_in, &reference);
  for (const ModelResult& result : comparison.results) {
    Positions positions = result.deformation.positions;
    SwapToOrFromLps(problem.written_in, &positions);
    PlanProblem with_arrays = problem;
    TF_ASSIGN_OR_RETURN(with_arrays.deformer.model, ModelFromName(result.model));
    AddDifferenceArrays(reference, positions, &with_arrays.point_data);
    TF_RETURN_IF_ERROR(WriteResult(ResultPath(options, result.model), comparison.plan, with_arrays,
                                   result.deformation.positions,
                                   {.material = result.band ? &*result.band : nullptr}));
  }
  return absl::OkStatus();
}

absl::Status WriteTable(const CompareOptions& options, const ModelComparison& comparison) {
  if (options.csv.empty()) return absl::OkStatus();
  CsvTable table = DistanceTable({"model", "reference"});
  for (const ModelResult& result : comparison.results) {
    AddDistanceRows({result.model, options.reference}, result.distances, &table);
  }
  return table.WriteCsv(options.csv);
}

OrderedJson ResultToJson(const ModelResult& result) {
  OrderedJson json = {{"prepare_seconds", result.prepare_seconds},
                      {"solve_seconds", result.solve_seconds},
                      {"iterations", result.deformation.summary.iterations},
                      {"converged", result.deformation.summary.converged},
                      {"inverted_tets", result.quality.inverted_tets}};
  for (const auto& [name, distances] : result.distances) {
    if (name == "all") {
      json["overall"] = DistancesToJson(distances);
    } else if (name == "skin") {
      json["skin"] = DistancesToJson(distances);
    } else {
      json["regions"][name] = DistancesToJson(distances);
    }
  }
  if (result.band) json["material_uncertainty"] = MaterialBandToJson(*result.band);
  return json;
}

void PrintJson(const CompareOptions& options, const ModelComparison& comparison) {
  OrderedJson json = {{"plan", options.a},
                      {"poisson_ratio", comparison.plan.poisson_ratio},
                      {"reference", options.reference},
                      {"models", OrderedJson::object()}};
  for (const ModelResult& result : comparison.results) {
    json["models"][result.model] = ResultToJson(result);
  }
  PrintJsonReport(json);
}

void PrintTables(const CompareOptions& options, const ModelComparison& comparison) {
  absl::PrintF("distance in mm between vertices of each model and of %s\n", options.reference);
  for (const ModelResult& result : comparison.results) {
    absl::PrintF("\n%s: %.3f s to prepare, %.3f s to solve, %d inverted tets%s\n", result.model,
                 result.prepare_seconds, result.solve_seconds, result.quality.inverted_tets,
                 result.deformation.summary.converged ? "" : ", NOT CONVERGED");
    if (result.band) absl::PrintF("%s\n", MaterialBandText(*result.band));
    if (result.model == options.reference) continue;
    PrintDistanceHeadline();
    PrintDistances(result.distances);
  }
}

}  // namespace

absl::Status CompareModels(const CompareOptions& options) {
  const std::vector<std::string> models = ModelsToRun(options);
  TF_RETURN_IF_ERROR(CheckOutputs(options, models));
  TF_ASSIGN_OR_RETURN(const ModelComparison comparison, RunModels(options, models));
  TF_RETURN_IF_ERROR(WriteResults(options, comparison));
  TF_RETURN_IF_ERROR(WriteTable(options, comparison));
  options.json ? PrintJson(options, comparison) : PrintTables(options, comparison);
  return absl::OkStatus();
}

}  // namespace tissueform
