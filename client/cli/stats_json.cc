// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/stats_json.h"

#include "client/cli/version.h"
#include "core/base/atomic_file.h"
#include "core/mesh_io/tet_mesh_io.h"
#include "core/planning/model_names.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

OrderedJson CountsToJson(const PredictionStats& stats) {
  return {{"vertices", stats.vertices},
          {"tets", stats.tets},
          {"fixed_vertices", stats.fixed_vertices},
          {"handle_vertices", stats.handle_vertices},
          {"free_vertices", stats.free_vertices}};
}

OrderedJson SecondsToJson(const PredictionStats& stats) {
  return {{"read", stats.read_seconds},
          {"assemble", stats.preparation.assemble_seconds},
          {"analyse", stats.preparation.analyse_seconds},
          {"factorise", stats.preparation.factorise_seconds},
          {"prepare", stats.preparation.prepare_seconds},
          {"solve", stats.solve.solve_seconds}};
}

OrderedJson QualityToJson(const PredictionStats& stats) {
  return {{"inverted_tets", stats.quality.inverted_tets},
          {"volume_ratio_min", stats.quality.min_volume_ratio},
          {"volume_ratio_max", stats.quality.max_volume_ratio},
          {"volume_ratio_total", stats.quality.total_volume_ratio},
          {"max_displacement_mm", stats.quality.max_displacement_mm},
          {"negative_weights", stats.preparation.negative_weights},
          {"harmonic_min", stats.preparation.harmonic_min},
          {"harmonic_max", stats.preparation.harmonic_max}};
}

}  // namespace

PredictionStats StatsOf(const PlanProblem& problem) {
  PredictionStats stats;
  stats.model = ModelName(problem.deformer.model);
  stats.rotation = RotationModeName(problem.deformer.gradient_field.rotation);
  stats.poisson_ratio = problem.deformer.preparation.poisson_ratio;
  stats.vertices = problem.mesh->num_vertices();
  stats.tets = problem.mesh->num_tets();
  const auto constrained = static_cast<Eigen::Index>(problem.constraints.constrained().size());
  stats.fixed_vertices = static_cast<Eigen::Index>(problem.constraints.fixed().size());
  stats.handle_vertices = constrained - stats.fixed_vertices;
  stats.free_vertices = stats.vertices - constrained;
  return stats;
}

OrderedJson StatsToJson(const PredictionStats& stats) {
  return {{"format", "tissueform-stats"},
          {"version", kVersion},
          {"model", stats.model},
          {"rotation", stats.rotation},
          {"poisson_ratio", stats.poisson_ratio},
          {"counts", CountsToJson(stats)},
          {"seconds", SecondsToJson(stats)},
          {"iterations", stats.solve.iterations},
          {"residual", stats.solve.residual},
          {"converged", stats.solve.converged},
          {"changes_mm", stats.solve.changes_mm},
          {"energies_nj", stats.solve.energies_nj},
          {"load", stats.solve.load},
          {"bytes_held", stats.preparation.bytes_held},
          {"quality", QualityToJson(stats)},
          {"notice", kNotMedicalDeviceNotice}};
}

absl::Status WriteStats(const std::string& path, const PredictionStats& stats) {
  return WriteFileAtomically(path, StatsToJson(stats).dump(2) + "\n");
}

}  // namespace tissueform
