// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// The plan file, word for word (docs/plan-format.md): what is predicted. Nothing here depends on a
// mesh yet; numbers are in the plan's own coordinate system.

// One of the selectors of a plan: vertices by number, by the value of a point array, inside a
// closed box, or the union of others.
struct VertexSelector;
struct SelectVertices {
  std::vector<int64_t> vertices;
};
struct SelectByPointData {
  std::string name;
  double equals = 0;
};
struct SelectBox {
  Eigen::Vector3d min_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d max_mm = Eigen::Vector3d::Zero();
};
struct SelectUnion {
  std::vector<VertexSelector> of;
};
struct VertexSelector {
  std::variant<SelectVertices, SelectByPointData, SelectBox, SelectUnion> choice;
};

// Young's modulus in Pa.
struct UniformStiffness {
  double pa = 0;
};
struct StiffnessFromCellData {
  std::string name;
};
struct StiffnessByCellData {
  std::string name;
  std::vector<std::pair<int64_t, double>> pa_of_value;
};
using StiffnessChoice = std::variant<UniformStiffness, StiffnessFromCellData, StiffnessByCellData>;

// Ranges of the material (version 2): factors as in MaterialUncertainty::Tissue.
struct FactorByCellData {
  std::string name;
  std::vector<std::pair<int64_t, double>> factor_of_value;
};
struct PlannedUncertainty {
  std::variant<double, FactorByCellData> youngs_modulus_factor_95 = 1.0;  // a number: of all
  std::optional<std::array<double, 2>> poisson_ratio_95;
};

struct PlannedHandle {
  std::string name;
  VertexSelector region;
  HandlePose pose;  // radians and mm, in the plan's coordinate system
};

// A row of contact (version 4), in the plan's coordinate system.
struct RestingBone {};
struct PlannedContactRow {
  int64_t vertex = 0;
  // What the vertex touches: bone that rests, the bone of a handle by its name, or another vertex.
  std::variant<RestingBone, std::string, int64_t> other;
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();  // towards `vertex`
  double gap_mm = 0;                                  // at rest
  bool bilateral = false;
};

struct Plan {
  CoordinateSystem coordinate_system = CoordinateSystem::kLps;
  std::string mesh_path;    // joined with the folder of the plan
  std::string mesh_sha256;  // of the mesh that the plan was made for; empty: of any
  StiffnessChoice stiffness;
  double poisson_ratio = 0.45;
  VertexSelector fixed;
  std::vector<PlannedHandle> handles;
  DeformationModel model = DeformationModel::kGradientField;
  GradientFieldOptions gradient_field;  // what the plan says; the rest keeps its defaults
  std::optional<PlannedUncertainty> uncertainty;
  std::vector<PlannedContactRow> contact;  // empty: tissue sticks to bone
  std::optional<LipEdge> lip_edge = {};    // that a seal may close; only with contact
};

}  // namespace tissueform
