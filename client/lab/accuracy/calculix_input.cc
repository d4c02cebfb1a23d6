// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/calculix_input.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

// Below this a number would need three digits of exponent, which do not fit into a field; no length
// in mm and no stiffness in Pa that means anything is as small.
constexpr double kSmallest = 1e-90;

// Pa per mm: a thousand times as stiff as a layer of tissue of 1 mm.
constexpr double kSurfaceSpring = 1.5e7;
// Pa mm^2: the pull of an open gap element, which cannot be zero.
constexpr double kGapTension = 1e-9;

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
      const double value =
          MotionScale(problem) * problem.displacements(static_cast<Eigen::Index>(c), axis);
      absl::StrAppend(text, constrained[c] + 1, ", ", axis + 1, ", ", axis + 1, ", ", Number(value),
                      "\n");
    }
  }
}

// The node of a row's bone.
Eigen::Index BoneNode(const CalculixProblem& problem, size_t row) {
  return problem.mesh.num_vertices() + 1 + static_cast<Eigen::Index>(row);
}

void AppendBoneNodes(const CalculixProblem& problem, std::string* text) {
  const std::vector<ContactRow>& rows = problem.constraints.contact();
  std::string nodes;
  for (size_t row = 0; row < rows.size(); ++row) {
    if (rows[row].other != ContactRow::kBone) continue;
    const auto place = problem.mesh.positions().row(rows[row].vertex);
    absl::StrAppend(&nodes, BoneNode(problem, row), ", ", Number(place[0]), ", ", Number(place[1]),
                    ", ", Number(place[2]), "\n");
  }
  if (!nodes.empty()) absl::StrAppend(text, "*NODE, NSET=BONE\n", nodes);
}

// n . (u_vertex - u_bone) = 0, by the unknown with the largest coefficient.
void AppendSliding(const CalculixProblem& problem, size_t row, std::string* text) {
  const ContactRow& of_row = problem.constraints.contact()[row];
  Eigen::Index largest = 0;
  of_row.normal.cwiseAbs().maxCoeff(&largest);
  absl::StrAppend(text, "*EQUATION\n6\n");
  for (int i = 0; i < 3; ++i) {
    const auto axis = static_cast<int>((largest + i) % 3);
    absl::StrAppend(text, of_row.vertex + 1, ", ", axis + 1, ", ", Number(of_row.normal[axis]),
                    "\n");
  }
  for (int axis = 0; axis < 3; ++axis) {
    absl::StrAppend(text, BoneNode(problem, row), ", ", axis + 1, ", ",
                    Number(-of_row.normal[axis]), "\n");
  }
}

// Closed when gap + n . (u_vertex - u_other) = 0; CalculiX counts from the element's first node.
void AppendGap(const CalculixProblem& problem, size_t row, std::string* text) {
  const ContactRow& of_row = problem.constraints.contact()[row];
  const Eigen::Index other =
      of_row.other == ContactRow::kBone ? BoneNode(problem, row) : of_row.other + 1;
  absl::StrAppend(text, "*ELEMENT, TYPE=GAPUNI, ELSET=G", row, "\n",
                  problem.mesh.num_tets() + 1 + static_cast<Eigen::Index>(row), ", ", other, ", ",
                  of_row.vertex + 1, "\n*GAP, ELSET=G", row, "\n",
                  Number(MotionScale(problem) * of_row.gap_mm));
  for (const double component : of_row.normal) absl::StrAppend(text, ", ", Number(component));
  absl::StrAppend(text, ", , ", Number(kGapSpring), ", ", Number(kGapTension), "\n");
}

// The element faces whose vertices are all among `vertices`, as a surface.
void AppendSurface(const CalculixProblem& problem, const std::set<int32_t>& vertices,
                   const std::string& name, std::string* text) {
  // CalculiX's faces S1 to S4 of a tet.
  constexpr int kFaces[4][3] = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
  absl::StrAppend(text, "*SURFACE, NAME=", name, ", TYPE=ELEMENT\n");
  for (Eigen::Index t = 0; t < problem.mesh.num_tets(); ++t) {
    const auto tet = problem.mesh.tets().row(t);
    for (int face = 0; face < 4; ++face) {
      const bool is_whole = std::ranges::all_of(
          kFaces[face], [&](int corner) { return vertices.contains(tet[corner]); });
      if (is_whole) absl::StrAppend(text, t + 1, ", S", face + 1, "\n");
    }
  }
}

void AppendContactPair(const CalculixProblem& problem, std::string* text) {
  std::set<int32_t> vertices;
  std::set<int32_t> others;
  for (const ContactRow& row : problem.constraints.contact()) {
    vertices.insert(row.vertex);
    others.insert(row.other);
  }
  AppendSurface(problem, vertices, "UPPER", text);
  AppendSurface(problem, others, "LOWER", text);
  absl::StrAppend(text,
                  "*SURFACE INTERACTION, NAME=TOUCH\n"
                  "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n",
                  Number(kSurfaceSpring),
                  "\n*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE\nUPPER, LOWER\n");
}

void AppendContact(const CalculixProblem& problem, std::string* text) {
  const std::vector<ContactRow>& rows = problem.constraints.contact();
  if (problem.contact == CalculixContact::kSurfaces) {
    AppendContactPair(problem, text);
    return;
  }
  for (size_t row = 0; row < rows.size(); ++row) {
    rows[row].bilateral ? AppendSliding(problem, row, text) : AppendGap(problem, row, text);
  }
}

void AppendBoneMotions(const CalculixProblem& problem, std::string* text) {
  const std::vector<ContactRow>& rows = problem.constraints.contact();
  for (size_t row = 0; row < rows.size(); ++row) {
    if (rows[row].other != ContactRow::kBone) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const double value = MotionScale(problem) *
                           problem.bone_motions[static_cast<Eigen::Index>(row)] *
                           rows[row].normal[axis];
      absl::StrAppend(text, BoneNode(problem, row), ", ", axis + 1, ", ", axis + 1, ", ",
                      Number(value), "\n");
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

Eigen::VectorXd BoneMotions(const TetMesh& mesh, const ConstraintSet& constraints,
                            absl::Span<const HandlePose> poses) {
  const std::vector<ContactRow>& rows = constraints.contact();
  Eigen::VectorXd motions = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(rows.size()));
  for (size_t row = 0; row < rows.size(); ++row) {
    if (rows[row].handle == ContactRow::kFixedBone) continue;
    const Eigen::Vector3d rest = mesh.positions().row(rows[row].vertex);
    motions[static_cast<Eigen::Index>(row)] =
        rows[row].normal.dot(ApplyPose(poses[static_cast<size_t>(rows[row].handle)], rest) - rest);
  }
  return motions;
}

double MotionScale(const CalculixProblem& problem) {
  const std::vector<ContactRow>& rows = problem.constraints.contact();
  const bool lifts_off =
      std::ranges::any_of(rows, [](const ContactRow& row) { return !row.bilateral; });
  const bool has_gap_elements = lifts_off && problem.contact == CalculixContact::kGapElements;
  return problem.law == CalculixLaw::kLinear && has_gap_elements ? kSmallMotion : 1;
}

std::string CalculixInput(const CalculixProblem& problem) {
  const bool is_linear = problem.law == CalculixLaw::kLinear && MotionScale(problem) == 1;
  std::string text;
  AppendNodes(problem.mesh.positions(), &text);
  AppendBoneNodes(problem, &text);
  const int tissues = AppendTissues(problem, &text);
  AppendContact(problem, &text);
  // Increments: first, whole, smallest and largest share of the load.
  // CalculiX turns the normals of a contact pair only between increments.
  const bool turns = !is_linear && problem.contact == CalculixContact::kSurfaces;
  absl::StrAppend(&text, is_linear ? "*STEP\n*STATIC\n" : "*STEP, NLGEOM, INC=1000\n*STATIC\n");
  if (!is_linear) absl::StrAppend(&text, turns ? "0.02, 1, 1e-5, 0.02\n" : "0.2, 1, 1e-5, 0.5\n");
  AppendBoundary(problem, &text);
  AppendBoneMotions(problem, &text);
  // CalculiX prints the last increment at any frequency.
  absl::StrAppend(&text, "*NODE PRINT, NSET=ALL, FREQUENCY=1000000\nU\n");
  if (problem.forces_and_stresses) AppendForcesAndStresses(tissues, &text);
  absl::StrAppend(&text, "*END STEP\n");
  return text;
}

}  // namespace tissueform
