// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/experiments/accuracy_table.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/deformation/comparison.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

DistanceSummary Distances(const Positions& a, const Positions& b) {
  const Eigen::VectorXd distances = (a - b).rowwise().norm();
  return SummarizeDistances({distances.begin(), distances.end()});
}

std::string Seconds(double seconds) { return absl::StrFormat("%.3f", seconds); }

// Mean and largest distance to the reference, or a dash where there is none.
std::string MeanAndMax(const ModelAnswer& model, const ModelAnswer* reference) {
  if (reference == nullptr) return "-";
  const DistanceSummary s = Distances(model.positions, reference->positions);
  // Below the digits of what CalculiX prints the figures say nothing.
  if (s.max_mm < 1e-3) return absl::StrFormat("%.0e / %.0e", s.mean_mm, s.max_mm);
  return absl::StrFormat("%.3f / %.3f", s.mean_mm, s.max_mm);
}

}  // namespace

CsvTable AccuracyTable() {
  return CsvTable({"case", "nu", "model", "reference", "region", "mean_mm", "p50_mm", "p90_mm",
                   "p95_mm", "max_mm", "mean_percent", "seconds", "reference_seconds",
                   "inverted_tets", "converged"});
}

void AddAccuracyRows(const AccuracyCase& problem, const std::vector<AccuracyResult>& results,
                     CsvTable* table) {
  const std::vector<int32_t> skin = BoundaryVertices(problem.mesh);
  for (const AccuracyResult& result : results) {
    for (const ModelAnswer& reference : result.references) {
      const double largest = LargestDisplacement(problem, reference);
      for (const ModelAnswer& model : result.models) {
        const auto add = [&](const char* region, const DistanceSummary& s) {
          table->AddRow({problem.name, Cell(result.poisson_ratio), model.name, reference.name,
                         region, Cell(s.mean_mm), Cell(s.p50_mm), Cell(s.p90_mm), Cell(s.p95_mm),
                         Cell(s.max_mm), Cell(100 * s.mean_mm / largest), Seconds(model.seconds),
                         Seconds(reference.seconds), absl::StrCat(model.inverted_tets),
                         model.converged ? "yes" : "no"});
        };
        add("all", Distances(model.positions, reference.positions));
        add("skin",
            Distances(model.positions(skin, Eigen::all), reference.positions(skin, Eigen::all)));
      }
    }
  }
}

CsvTable AccuracySummary() {
  return CsvTable(
      {"case", "model", "CalculiX linear", "CalculiX neo-Hookean", "seconds", "inverted tets"});
}

void AddSummaryRows(const AccuracyCase& problem, const AccuracyResult& result, CsvTable* table) {
  for (const ModelAnswer& model : result.models) {
    table->AddRow({problem.name, model.name, MeanAndMax(model, result.Reference("calculix_linear")),
                   MeanAndMax(model, result.Reference("calculix_neo_hookean")),
                   absl::StrFormat("%.2f", model.seconds), absl::StrCat(model.inverted_tets)});
  }
}

}  // namespace tissueform
