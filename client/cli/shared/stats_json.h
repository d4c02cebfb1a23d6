// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "nlohmann/json.hpp"

#include "client/cli/shared/elastic_results.h"
#include "client/cli/shared/total_band.h"
#include "client/cli/shared/uncertainty_results.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/problem/contact_summary.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// What STATS.json reports about one prediction.
struct PredictionStats {
  std::string model;         // as in the plan
  std::string rotation;      // mode of the gradient field
  double poisson_ratio = 0;  // of the elastic models
  int solver_threads = 1;
  Eigen::Index vertices = 0;
  Eigen::Index tets = 0;
  Eigen::Index fixed_vertices = 0;
  Eigen::Index handle_vertices = 0;
  Eigen::Index free_vertices = 0;
  double read_seconds = 0;
  PreparationSummary preparation;
  SolveSummary solve;
  ContactUse contact_use = ContactUse::kNone;
  size_t contact_rows = 0;                // that were used
  std::optional<ContactSummary> contact;  // of answers with rows that may lift off
  std::optional<SealAnswer> seal;         // of lips that were asked to be sealed
  DeformationQuality quality;
  std::optional<ElasticSummary> elastic;  // of the elastic models
  bool has_ranges = false;                // the plan gives ranges of the material
  std::optional<MaterialBand> band;       // where it does, of the elastic models
  std::optional<TotalBand> total_band;    // of the elastic models, where the mesh names places
};

// The counts, model and mode of a problem; the rest is left for the caller to fill.
PredictionStats StatsOf(const PlanProblem& problem);

// What every result states of sealed lips.
nlohmann::ordered_json SealToJson(const SealAnswer& seal);
std::string SealText(const SealAnswer& seal);

// Keys in the order in which docs/plan-format.md lists them; with version and notice.
nlohmann::ordered_json StatsToJson(const PredictionStats& stats);

// What of the answer was not reached, and why, without a full stop; empty where all was.
std::string NotReachedText(const SolveSummary& solve);

// One line on stdout, and a warning on stderr where tets are inverted or the answer is not what was
// asked for.
void PrintOutcome(const std::string& out, const PredictionStats& stats);

// All or nothing, like WriteFileAtomically.
absl::Status WriteStats(const std::string& path, const PredictionStats& stats);

}  // namespace tissueform
