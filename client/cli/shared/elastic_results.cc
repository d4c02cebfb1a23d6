// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/elastic_results.h"

#include <limits>
#include <set>
#include <utility>

#include "core/base/percentiles.h"
#include "core/mechanics/elasticity/tet_strain.h"
#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::optional<ElasticLaw> LawOf(const PlanProblem& problem) {
  switch (problem.deformer.model) {
    case DeformationModel::kLinearElastic:
      return ElasticLaw::kLinear;
    case DeformationModel::kNeoHookean:
      return ElasticLaw::kNeoHookean;
    default:
      return std::nullopt;
  }
}

ElasticState StateOf(ElasticLaw law, const PlanProblem& problem, const Positions& deformed) {
  return MeasureElasticState(law, ElementsOf(*problem.mesh), deformed, problem.stiffness,
                             problem.deformer.preparation.poisson_ratio);
}

template <typename Number, typename Values>
Attribute ArrayOf(const char* name, int components, const Values& values) {
  return {name, components, std::vector<Number>(values.data(), values.data() + values.size())};
}

// Those that contact rows name, rising: there the force is that of bone or of the other lip.
std::vector<int32_t> TouchingVertices(const PlanProblem& problem) {
  std::set<int32_t> vertices;
  for (const ContactRow& row : problem.constraints.contact()) {
    vertices.insert(row.vertex);
    if (row.other != ContactRow::kBone) vertices.insert(row.other);
  }
  return {vertices.begin(), vertices.end()};
}

Attribute ReactionArray(const PlanProblem& problem, const ElasticState& state) {
  Positions reactions = Positions::Zero(state.forces_n.rows(), 3);
  for (const int32_t v : problem.constraints.constrained()) {
    reactions.row(v) = state.forces_n.row(v);
  }
  for (const int32_t v : TouchingVertices(problem)) reactions.row(v) = state.forces_n.row(v);
  SwapToOrFromLps(problem.written_in, &reactions);
  return ArrayOf<double>(kReactionForceArray, 3, reactions);
}

OrderedJson VectorToJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

void SummarizeTets(const PlanProblem& problem, const Positions& deformed,
                   const Eigen::VectorXd& von_mises, ElasticSummary* summary) {
  // An inverted tet has none, and would be lost among the ranks.
  const double none = std::numeric_limits<double>::quiet_NaN();
  const bool all_have = von_mises.allFinite();
  const std::vector<double> stresses(von_mises.begin(), von_mises.end());
  summary->von_mises_p50_pa = all_have ? Percentile(stresses, 50) : none;
  summary->von_mises_p95_pa = all_have ? Percentile(stresses, 95) : none;
  ElasticSummary::Extreme& stress = summary->von_mises_max_pa;
  stress.value = von_mises.maxCoeff<Eigen::PropagateNaN>(&stress.tet);
  const PrincipalValues strains = PrincipalGreenStrains(ElementsOf(*problem.mesh), deformed,
                                                        problem.deformer.preparation.threads);
  ElasticSummary::Extreme& longest = summary->principal_strain_max;
  longest.value = strains.col(0).maxCoeff(&longest.tet);
  ElasticSummary::Extreme& shortest = summary->principal_strain_min;
  shortest.value = strains.col(2).minCoeff(&shortest.tet);
}

void AddResultant(const Resultant& resultant, OrderedJson* json) {
  (*json)["force_n"] = VectorToJson(resultant.force_n);
  (*json)["moment_n_mm"] = VectorToJson(resultant.moment_n_mm);
  (*json)["about_mm"] = VectorToJson(resultant.about_mm);
}

}  // namespace

void AddElasticArrays(const PlanProblem& problem, const Positions& deformed, TetMeshFile* file) {
  const std::optional<ElasticLaw> law = LawOf(problem);
  if (!law) return;
  const ElasticState state = StateOf(*law, problem, deformed);
  file->cell_data.push_back(ArrayOf<double>(kVonMisesStressArray, 1, state.von_mises_pa));
  // Most of the cost of a large array is its compression.
  file->cell_data.push_back(ArrayOf<float>(kEnergyDensityArray, 1, state.energy_density_pa));
  file->point_data.push_back(ReactionArray(problem, state));
}

std::optional<ElasticSummary> SummarizeElastic(const PlanProblem& problem,
                                               const Positions& deformed) {
  const std::optional<ElasticLaw> law = LawOf(problem);
  if (!law) return std::nullopt;
  const ElasticState state = StateOf(*law, problem, deformed);
  ElasticSummary summary;
  SummarizeTets(problem, deformed, state.von_mises_pa, &summary);
  summary.strain_energy_mj = state.strain_energy_mj;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const Eigen::Array3d signs = SignsToLps(problem.written_in);
  const auto reaction_of = [&](const std::vector<int32_t>& vertices) {
    Resultant reaction = ResultantOf(state, vertices);
    sum += reaction.force_n;
    // RAS is LPS turned by half a turn, so a moment changes as a force does.
    for (Eigen::Vector3d* vector : {&reaction.force_n, &reaction.moment_n_mm, &reaction.about_mm}) {
      vector->array() *= signs;
    }
    return reaction;
  };
  summary.fixed = reaction_of(problem.constraints.fixed());
  for (const HandleRegion& handle : problem.constraints.handles()) {
    summary.handles.push_back({handle.name, reaction_of(handle.vertices)});
  }
  if (const std::vector<int32_t> touching = TouchingVertices(problem); !touching.empty()) {
    summary.contact = reaction_of(touching);
  }
  summary.unbalanced_force_n = sum.norm();
  return summary;
}

OrderedJson ElasticToJson(const ElasticSummary& summary) {
  const ElasticSummary::Extreme& longest = summary.principal_strain_max;
  const ElasticSummary::Extreme& shortest = summary.principal_strain_min;
  OrderedJson json = {{"von_mises_stress_pa",
                       {{"p50", summary.von_mises_p50_pa},
                        {"p95", summary.von_mises_p95_pa},
                        {"max", summary.von_mises_max_pa.value},
                        {"max_tet", summary.von_mises_max_pa.tet}}},
                      {"principal_strain",
                       {{"max", longest.value},
                        {"max_tet", longest.tet},
                        {"min", shortest.value},
                        {"min_tet", shortest.tet}}},
                      {"strain_energy_mj", summary.strain_energy_mj},
                      {"unbalanced_force_n", summary.unbalanced_force_n},
                      {"fixed", OrderedJson::object()},
                      {"handles", OrderedJson::array()}};
  AddResultant(summary.fixed, &json["fixed"]);
  for (const ElasticSummary::HandleReaction& handle : summary.handles) {
    OrderedJson of_handle = {{"name", handle.name}};
    AddResultant(handle.reaction, &of_handle);
    json["handles"].push_back(std::move(of_handle));
  }
  if (summary.contact) {
    json["contact"] = OrderedJson::object();
    AddResultant(*summary.contact, &json["contact"]);
  }
  return json;
}

}  // namespace tissueform
