// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/accuracy_table.h"

#include <numeric>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/percentiles.h"
#include "core/mechanics/deformation/comparison.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

// What the field accepts as the error of a prediction.
constexpr double kAcceptedMm = 2;

Eigen::VectorXd Distances(const Positions& a, const Positions& b) {
  return (a - b).rowwise().norm();
}

Eigen::VectorXd DistancesAt(const std::vector<int32_t>& vertices, const Positions& a,
                            const Positions& b) {
  return Distances(a(vertices, Eigen::all), b(vertices, Eigen::all));
}

DistanceSummary Summary(const Eigen::VectorXd& distances) {
  return SummarizeDistances({distances.begin(), distances.end()});
}

double P99(const Eigen::VectorXd& distances) {
  return Percentile({distances.begin(), distances.end()}, 99);
}

std::vector<SkinPlace> TableRegions(const AccuracyCase& problem) {
  std::vector<int32_t> all(static_cast<size_t>(problem.mesh.num_vertices()));
  std::iota(all.begin(), all.end(), 0);
  std::vector<SkinPlace> regions = {{"all", std::move(all)},
                                    {"skin", BoundaryVertices(problem.mesh)}};
  regions.insert(regions.end(), problem.places.begin(), problem.places.end());
  return regions;
}

std::string Seconds(double seconds) { return absl::StrFormat("%.3f", seconds); }

// Mean and largest distance to the reference, or a dash without a reference.
std::string MeanAndMax(const ModelAnswer& model, const ModelAnswer* reference) {
  if (reference == nullptr) return "-";
  const DistanceSummary s = Summary(Distances(model.positions, reference->positions));
  // Below the digits of what CalculiX prints the figures say nothing.
  if (s.max_mm < 1e-3) return absl::StrFormat("%.0e / %.0e", s.mean_mm, s.max_mm);
  return absl::StrFormat("%.3f / %.3f", s.mean_mm, s.max_mm);
}

std::vector<std::string> Row(const AccuracyCase& problem, double poisson_ratio,
                             const ModelAnswer& model, const ModelAnswer& reference,
                             const SkinPlace& region) {
  const Eigen::VectorXd distances =
      DistancesAt(region.vertices, model.positions, reference.positions);
  const DistanceSummary s = Summary(distances);
  const double largest = LargestDisplacement(problem, reference);
  return {problem.name,
          Cell(poisson_ratio),
          model.name,
          reference.name,
          region.name,
          Cell(s.mean_mm),
          Cell(s.p50_mm),
          Cell(s.p90_mm),
          Cell(s.p95_mm),
          Cell(P99(distances)),
          Cell(s.max_mm),
          Cell(100 * s.mean_mm / largest),
          Seconds(model.seconds),
          Seconds(reference.seconds),
          absl::StrCat(model.inverted_tets),
          model.converged ? "yes" : "no",
          absl::StrCat(s.count),
          absl::StrCat((distances.array() > kAcceptedMm).count())};
}

}  // namespace

CsvTable AccuracyTable() {
  return CsvTable({"case", "nu", "model", "reference", "region", "mean_mm", "p50_mm", "p90_mm",
                   "p95_mm", "p99_mm", "max_mm", "mean_percent", "seconds", "reference_seconds",
                   "inverted_tets", "converged", "vertices", "vertices_over_2_mm"});
}

void AddAccuracyRows(const AccuracyCase& problem, const std::vector<AccuracyResult>& results,
                     CsvTable* table) {
  const std::vector<SkinPlace> regions = TableRegions(problem);
  for (const AccuracyResult& result : results) {
    for (const ModelAnswer& reference : result.references) {
      for (const ModelAnswer& model : result.models) {
        for (const SkinPlace& region : regions) {
          table->AddRow(Row(problem, result.poisson_ratio, model, reference, region));
        }
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

CsvTable PlaceSummary() {
  std::vector<std::string> header = {"case", "place", "vertices"};
  for (const ModelVariant& variant : AllModelVariants()) header.push_back(variant.name);
  return CsvTable(std::move(header));
}

void AddPlaceSummaryRows(const AccuracyCase& problem, const AccuracyResult& result,
                         CsvTable* table) {
  const ModelAnswer* reference = result.Reference("calculix_neo_hookean");
  if (reference == nullptr) return;
  for (const SkinPlace& place : problem.places) {
    std::vector<std::string> cells = {problem.name, place.name,
                                      absl::StrCat(place.vertices.size())};
    for (const ModelVariant& variant : AllModelVariants()) {
      const Eigen::VectorXd distances =
          DistancesAt(place.vertices, result.Model(variant.name)->positions, reference->positions);
      const DistanceSummary s = Summary(distances);
      cells.push_back(absl::StrFormat("%.2f / %.2f / %.2f / %.2f", s.p50_mm, s.p95_mm,
                                      P99(distances), s.max_mm));
    }
    table->AddRow(std::move(cells));
  }
}

}  // namespace tissueform
