// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/calculix_input.h"

#include <cmath>
#include <map>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

// Below this a number would need three digits of exponent, which do not fit into a field; no length
// in mm and no stiffness in Pa that means anything is as small.
constexpr double kSmallest = 1e-90;

std::string Number(double value) {
  return std::abs(value) < kSmallest ? "0" : absl::StrFormat("%.13g", value);
}

void AppendNodes(const Positions& positions, std::string* text) {
  absl::StrAppend(text, "*NODE, NSET=ALL\n");
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    absl::StrAppend(text, v + 1, ", ", Number(positions(v, 0)), ", ", Number(positions(v, 1)), ", ",
                    Number(positions(v, 2)), "\n");
  }
}

void AppendElements(const CalculixProblem& problem, const std::vector<Eigen::Index>& tets,
                    const std::string& set, std::string* text) {
  absl::StrAppend(text, "*ELEMENT, TYPE=C3D4, ELSET=", set, "\n");
  for (const Eigen::Index t : tets) {
    absl::StrAppend(text, t + 1);
    for (const int32_t vertex : problem.mesh.tets().row(t)) {
      absl::StrAppend(text, ", ", vertex + 1);
    }
    absl::StrAppend(text, "\n");
  }
}

void AppendMaterial(const CalculixProblem& problem, double youngs_modulus, const std::string& name,
                    std::string* text) {
  const double nu = problem.poisson_ratio;
  absl::StrAppend(text, "*MATERIAL, NAME=", name, "\n");
  if (problem.law == CalculixLaw::kLinear) {
    absl::StrAppend(text, "*ELASTIC\n", Number(youngs_modulus), ", ", Number(nu), "\n");
  } else {
    // W = C10 (J^(-2/3) I1 - 3) + (J - 1)^2 / D1 with C10 = mu / 2 and D1 = 2 / K: our law.
    absl::StrAppend(text, "*HYPERELASTIC, NEO HOOKE\n", Number(youngs_modulus / (4 * (1 + nu))),
                    ", ", Number(6 * (1 - 2 * nu) / youngs_modulus), "\n");
  }
}

// Elements, material and section for each distinct stiffness. Returns how many there are; their
// sets are E1, E2 and so on.
int AppendTissues(const CalculixProblem& problem, std::string* text) {
  std::map<double, std::vector<Eigen::Index>> tets_of_stiffness;
  for (Eigen::Index t = 0; t < problem.stiffness.size(); ++t) {
    tets_of_stiffness[problem.stiffness[t]].push_back(t);
  }
  int number = 0;
  for (const auto& [youngs_modulus, tets] : tets_of_stiffness) {
    const std::string set = absl::StrCat("E", ++number);
    const std::string material = absl::StrCat("M", number);
    AppendElements(problem, tets, set, text);
    AppendMaterial(problem, youngs_modulus, material, text);
    absl::StrAppend(text, "*SOLID SECTION, ELSET=", set, ", MATERIAL=", material, "\n");
  }
  return number;
}

void AppendBoundary(const CalculixProblem& problem, std::string* text) {
  absl::StrAppend(text, "*BOUNDARY\n");
  const std::vector<int32_t>& constrained = problem.constraints.constrained();
  for (size_t c = 0; c < constrained.size(); ++c) {
    for (int axis = 0; axis < 3; ++axis) {
      const double value = problem.displacements(static_cast<Eigen::Index>(c), axis);
      absl::StrAppend(text, constrained[c] + 1, ", ", axis + 1, ", ", axis + 1, ", ", Number(value),
                      "\n");
    }
  }
}

void AppendForcesAndStresses(int tissues, std::string* text) {
  absl::StrAppend(text, "*NODE PRINT, NSET=ALL, FREQUENCY=1000000\nRF\n");
  for (int tissue = 1; tissue <= tissues; ++tissue) {
    absl::StrAppend(text, "*EL PRINT, ELSET=E", tissue, ", FREQUENCY=1000000\nS\n");
  }
}

}  // namespace

Positions ConstrainedDisplacements(const TetMesh& mesh, const ConstraintSet& constraints,
                                   absl::Span<const HandlePose> poses) {
  const std::vector<int32_t>& constrained = constraints.constrained();
  Positions displacements = Positions::Zero(static_cast<Eigen::Index>(constrained.size()), 3);
  for (size_t c = 0; c < constrained.size(); ++c) {
    const int region = constraints.region_of_constrained()[c];
    if (region == ConstraintSet::kFixed) continue;
    const Eigen::Vector3d rest = mesh.positions().row(constrained[c]).transpose();
    displacements.row(static_cast<Eigen::Index>(c)) =
        (ApplyPose(poses[static_cast<size_t>(region)], rest) - rest).transpose();
  }
  return displacements;
}

std::string CalculixInput(const CalculixProblem& problem) {
  const bool is_linear = problem.law == CalculixLaw::kLinear;
  std::string text;
  AppendNodes(problem.mesh.positions(), &text);
  const int tissues = AppendTissues(problem, &text);
  // Increments: first, whole, smallest and largest share of the load.
  absl::StrAppend(&text, is_linear ? "*STEP\n*STATIC\n"
                                   : "*STEP, NLGEOM, INC=1000\n*STATIC\n0.2, 1, 1e-5, 0.5\n");
  AppendBoundary(problem, &text);
  // The last increment is printed whatever the frequency.
  absl::StrAppend(&text, "*NODE PRINT, NSET=ALL, FREQUENCY=1000000\nU\n");
  if (problem.forces_and_stresses) AppendForcesAndStresses(tissues, &text);
  absl::StrAppend(&text, "*END STEP\n");
  return text;
}

}  // namespace tissueform
