// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/uncertainty_results.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/stage_progress.h"
#include "core/base/percentiles.h"
#include "core/base/status_macros.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/skin_places.h"

namespace tissueform {
namespace {

bool IsElastic(const PlanProblem& problem) { return TraitsOf(problem.deformer.model).is_elastic; }

std::vector<int32_t> WithoutConstrained(std::vector<int32_t> vertices,
                                        const ConstraintSet& constraints) {
  std::erase_if(vertices, [&](int32_t vertex) {
    return std::binary_search(constraints.constrained().begin(), constraints.constrained().end(),
                              vertex);
  });
  return vertices;
}

// Those with free vertices.
absl::StatusOr<std::vector<SkinPlace>> FreePlaces(const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(std::vector<SkinPlace> places, SkinPlaces(problem.point_data));
  places.insert(places.begin(), {"surface", BoundaryVertices(*problem.mesh)});
  for (SkinPlace& place : places) {
    place.vertices = WithoutConstrained(std::move(place.vertices), problem.constraints);
  }
  std::erase_if(places, [](const SkinPlace& place) { return place.vertices.empty(); });
  return places;
}

MaterialBand::Place Summarize(const SkinPlace& place, const Eigen::VectorXd& band_mm) {
  std::vector<double> values;
  for (const int32_t vertex : place.vertices) values.push_back(band_mm[vertex]);
  const Eigen::Map<const Eigen::VectorXd> all(values.data(),
                                              static_cast<Eigen::Index>(values.size()));
  return {place.name, all.size(), all.mean(), Percentile(values, 95), all.maxCoeff()};
}

// The 95th percentile of one normal variable's distance, averaged.
double MeanOf(const AnswerExpansion::Term& term, const std::vector<int32_t>& vertices) {
  double sum = 0;
  for (const int32_t vertex : vertices) {
    sum += kNormal95 * term.field.col(0).segment<3>(3 * vertex).norm();
  }
  return sum / static_cast<double>(vertices.size());
}

std::vector<MaterialBand::Cause> CausesOf(const AnswerExpansion& expansion,
                                          const MaterialUncertainty& uncertainty,
                                          const std::vector<int32_t>& vertices) {
  std::vector<MaterialBand::Cause> causes;
  for (const auto& term : expansion.terms) {
    if (term.second != AnswerExpansion::kNone) continue;
    const auto variable = static_cast<size_t>(term.first);
    causes.push_back({variable < uncertainty.tissues.size() ? uncertainty.tissues[variable].name
                                                            : "Poisson's ratio",
                      MeanOf(term, vertices)});
  }
  return causes;
}

Attribute ScalarArray(const char* name, const Eigen::VectorXd& values) {
  return {name, 1, std::vector<double>(values.begin(), values.end())};
}

}  // namespace

absl::StatusOr<std::optional<MaterialBand>> FindMaterialBand(
    const PlanProblem& problem, const Positions& deformed,
    std::shared_ptr<MeshPreparation> preparation) {
  if (!problem.uncertainty || !IsElastic(problem)) return std::nullopt;
  TF_ASSIGN_OR_RETURN(const std::vector<SkinPlace> places, FreePlaces(problem));
  if (preparation == nullptr) {
    TF_ASSIGN_OR_RETURN(
        preparation, MeshPreparation::Create(*problem.mesh, problem.stiffness, problem.constraints,
                                             problem.deformer.preparation));
  }
  MaterialBand band;
  TF_ASSIGN_OR_RETURN(band.expansion,
                      ExpandAnswer(preparation.get(), problem.deformer.model, *problem.uncertainty,
                                   problem.poses, deformed, ExpansionOrder::kSecond));
  band.band = SampleBand(band.expansion, SurfaceNormals(*problem.mesh, deformed),
                         problem.deformer.preparation.threads);
  for (const SkinPlace& place : places) {
    band.places.push_back(Summarize(place, band.band.size_mm));
  }
  if (!places.empty()) {
    band.causes = CausesOf(band.expansion, *problem.uncertainty, places.back().vertices);
  }
  return band;
}

void WarnOfMissingBand(const PlanProblem& problem, absl::string_view why) {
  if (!problem.uncertainty || !IsElastic(problem)) return;
  absl::FPrintF(stderr, "warning: material uncertainty is omitted: %s\n", why);
}

std::optional<MaterialBand> FindMaterialBandOrWarn(const PlanProblem& problem,
                                                   const Positions& deformed,
                                                   std::shared_ptr<MeshPreparation> preparation) {
  if (!problem.uncertainty || !IsElastic(problem)) return std::nullopt;
  const StageProgress progress("computing the material uncertainty");
  absl::StatusOr<std::optional<MaterialBand>> band =
      FindMaterialBand(problem, deformed, std::move(preparation));
  if (band.ok()) return *std::move(band);
  WarnOfMissingBand(problem, band.status().message());
  return std::nullopt;
}

void AddMaterialBand(const MaterialBand& band, TetMeshFile* file) {
  file->point_data.push_back(ScalarArray(kMaterialUncertaintyArray, band.band.size_mm));
  file->point_data.push_back(ScalarArray(kMaterialUncertaintyNormalArray, band.band.normal_mm));
}

}  // namespace tissueform
