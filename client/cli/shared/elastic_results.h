// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/base/types.h"
#include "core/mechanics/elasticity/elastic_state.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {

// What results of linear_elastic and neo_hookean report beyond positions, in files and in
// statistics. All of it is found from the positions, so answers of a server, which come in single
// precision, have it as well.

// Cell arrays; the latter in single precision.
inline constexpr char kVonMisesStressArray[] = "von_mises_stress_pa";
inline constexpr char kEnergyDensityArray[] = "strain_energy_density_pa";
// Point array: what holds a fixed vertex or one of a handle where it is, and what bone or the other
// lip does to a vertex that contact rows name; zero at the other free ones.
inline constexpr char kReactionForceArray[] = "reaction_force_n";

// Adds the arrays to `file` where the problem's model is elastic. `deformed` is #V by 3, LPS.
void AddElasticArrays(const PlanProblem& problem, const Positions& deformed, TetMeshFile* file);

// In the plan's own coordinate system.
struct ElasticSummary {
  struct HandleReaction {
    std::string name;
    Resultant reaction;
  };
  // A value of some tet, the largest or smallest of all.
  struct Extreme {
    double value = 0;
    Eigen::Index tet = 0;
  };
  double von_mises_p50_pa = 0;  // over the tets; not a number where one has no stress
  double von_mises_p95_pa = 0;
  Extreme von_mises_max_pa;
  Extreme principal_strain_max;  // Green-Lagrange
  Extreme principal_strain_min;
  double strain_energy_mj = 0;
  double unbalanced_force_n = 0;  // length of the sum of all reactions
  Resultant fixed;
  std::vector<HandleReaction> handles;  // without what their bone does through contact rows
  std::optional<Resultant> contact;     // of all vertices that contact rows name
};

// Nothing where the problem's model is not elastic.
std::optional<ElasticSummary> SummarizeElastic(const PlanProblem& problem,
                                               const Positions& deformed);

// Keys in the order in which docs/plan-format.md lists them; null for what is not finite.
nlohmann::ordered_json ElasticToJson(const ElasticSummary& summary);

}  // namespace tissueform
