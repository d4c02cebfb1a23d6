// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/stats_json.h"

#include <cstdio>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/uncertainty_text.h"
#include "client/cli/shared/version.h"
#include "core/base/atomic_file.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mesh/io/tet_mesh_io.h"
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
          {"worst_tet", stats.quality.worst_tet},
          {"volume_ratio_min", stats.quality.min_volume_ratio},
          {"volume_ratio_max", stats.quality.max_volume_ratio},
          {"volume_ratio_total", stats.quality.total_volume_ratio},
          {"max_displacement_mm", stats.quality.max_displacement_mm},
          {"negative_weights", stats.preparation.negative_weights},
          {"harmonic_min", stats.preparation.harmonic_min},
          {"harmonic_max", stats.preparation.harmonic_max}};
}

OrderedJson ContactToJson(const PredictionStats& stats) {
  if (stats.contact_use == ContactUse::kLeftOut) return {{"use", "off"}};
  OrderedJson json = {{"use", "on"}, {"rows", stats.contact_rows}};
  if (!stats.contact) return json;
  json["unilateral_rows"] = stats.contact->rows;
  json["pressing_rows"] = stats.contact->pressing_rows;
  if (stats.contact->max_force_n) json["max_force_n"] = *stats.contact->max_force_n;
  json["residual_mm"] = stats.contact->residual_mm;
  if (stats.seal) json["seal"] = SealToJson(*stats.seal);
  return json;
}

std::string ContactText(const PredictionStats& stats) {
  if (stats.contact_use == ContactUse::kLeftOut) {
    return "contact: off; tissue sticks and the lips are one piece";
  }
  std::string text = absl::StrCat("contact: ", stats.contact_rows, " rows");
  if (!stats.contact) return text;
  absl::StrAppendFormat(&text, ", %d of %d press", stats.contact->pressing_rows,
                        stats.contact->rows);
  if (stats.contact->max_force_n) {
    absl::StrAppendFormat(&text, ", largest force %.3g N", *stats.contact->max_force_n);
  }
  absl::StrAppendFormat(&text, ", residual %.2g mm", stats.contact->residual_mm);
  if (stats.seal) absl::StrAppend(&text, ", ", SealText(*stats.seal));
  return text;
}

// To follow what was not reached: begins with a colon, or is empty.
std::string WhyItGaveUp(const SolveSummary& solve) {
  std::string why;
  switch (solve.gave_up) {
    case Termination::kConverged:
    case Termination::kBlocked:  // the obstacle says it all
      break;
    case Termination::kIterations:
      why = ": iteration limit reached";
      break;
    case Termination::kNoRoom:
      why = ": out of memory for the second factor";
      break;
    case Termination::kArithmetic:
      why = ": no further improvement";
      break;
  }
  return solve.obstacle.empty() ? why
                                : absl::StrCat(why, why.empty() ? ": " : "; ", solve.obstacle);
}

}  // namespace

nlohmann::ordered_json SealToJson(const SealAnswer& seal) {
  return {{"pairs", seal.pairs},
          {"released", seal.released},
          {"parted_mm", seal.parted_mm},
          {"release_mm", kSealReleaseMm}};
}

std::string SealText(const SealAnswer& seal) {
  if (!seal.released) return absl::StrFormat("sealed: %d pairs, released: no", seal.pairs);
  return absl::StrFormat("sealed: 0 of %d pairs, released: yes (parted by %.1f mm, limit %.0f mm)",
                         seal.pairs, seal.parted_mm, kSealReleaseMm);
}

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
  stats.contact_use = problem.contact_use;
  stats.contact_rows = problem.constraints.contact().size();
  stats.has_ranges = problem.uncertainty.has_value();
  return stats;
}

OrderedJson StatsToJson(const PredictionStats& stats) {
  OrderedJson json = {{"format", "tissueform-stats"},
                      {"version", kVersion},
                      {"model", stats.model},
                      {"rotation", stats.rotation},
                      {"poisson_ratio", stats.poisson_ratio},
                      {"counts", CountsToJson(stats)},
                      {"seconds", SecondsToJson(stats)},
                      {"iterations", stats.solve.iterations},
                      {"newton_steps", stats.solve.newton_steps},
                      {"residual", stats.solve.residual},
                      {"converged", stats.solve.converged},
                      {"changes_mm", stats.solve.changes_mm},
                      {"energies_nj", stats.solve.energies_nj},
                      {"load", stats.solve.load},
                      {"gave_up", TerminationName(stats.solve.gave_up)},
                      {"obstacle", stats.solve.obstacle},
                      {"second_factor_bytes", stats.solve.second_factor_bytes},
                      {"solver_threads", stats.solver_threads},
                      {"bytes_held", stats.preparation.bytes_held},
                      {"quality", QualityToJson(stats)}};
  if (stats.contact_use != ContactUse::kNone) json["contact"] = ContactToJson(stats);
  if (stats.elastic) json["elastic"] = ElasticToJson(*stats.elastic);
  if (stats.band) json["material_uncertainty"] = MaterialBandToJson(*stats.band);
  if (stats.total_band) json["uncertainty"] = TotalBandToJson(*stats.total_band);
  json["notice"] = kNotMedicalDeviceNotice;
  return json;
}

std::string NotReachedText(const SolveSummary& solve) {
  if (solve.load < 1) {
    return absl::StrFormat("only %.0f %% of the movement was reached%s", 100 * solve.load,
                           WhyItGaveUp(solve));
  }
  if (solve.converged) return "";
  return absl::StrFormat("not converged after %d iterations (residual %.2g)%s", solve.iterations,
                         solve.residual, WhyItGaveUp(solve));
}

void PrintOutcome(const std::string& out, const PredictionStats& stats) {
  const DeformationQuality& quality = stats.quality;
  absl::PrintF("%s: %d vertices, largest displacement %.3f mm, volume x %.4f, %d inverted tets\n",
               out, stats.vertices, quality.max_displacement_mm, quality.total_volume_ratio,
               quality.inverted_tets);
  if (stats.contact_use != ContactUse::kNone) absl::PrintF("%s\n", ContactText(stats));
  if (stats.band) {
    absl::PrintF("%s\n", MaterialBandText(*stats.band));
  } else if (stats.has_ranges && stats.contact_use != ContactUse::kOn) {
    absl::PrintF("material uncertainty: only for linear_elastic and neo_hookean\n");
  }
  if (stats.total_band) absl::PrintF("%s", TotalBandText(*stats.total_band));
  if (quality.inverted_tets > 0) {
    absl::FPrintF(
        stderr,
        "warning: tets are inverted, the worst is tet %d (volume x %.3g); use smaller movements or "
        "neo_hookean\n",
        quality.worst_tet, quality.min_volume_ratio);
  }
  if (const std::string text = NotReachedText(stats.solve); !text.empty()) {
    absl::FPrintF(stderr, "warning: %s; the file holds %s state\n", text,
                  stats.solve.load < 1 ? "that" : "the best");
  }
}

absl::Status WriteStats(const std::string& path, const PredictionStats& stats) {
  return WriteFileAtomically(path, StatsToJson(stats).dump(2) + "\n");
}

}  // namespace tissueform
