// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/uncertainty/material_uncertainty.h"
#include "core/mesh/attribute.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The axes in which a plan and its mesh are written. RAS and LPS differ by the signs of x and y:
// half a turn about z. It is its own inverse and keeps handedness, so positions, translations and
// rotation vectors all change in the same way and tets stay positive.
enum class CoordinateSystem { kLps, kRas };

// From `system` to LPS or back.
void SwapToOrFromLps(CoordinateSystem system, Positions* positions);
HandlePose SwapToOrFromLps(CoordinateSystem system, const HandlePose& pose);

// The signs of the axes: (1, 1, 1) or (-1, -1, 1).
Eigen::Vector3d SignsToLps(CoordinateSystem system);

// A free vertex that touches bone by contact rows, and the region that it would stick to without
// them: ConstraintSet::kFixed or the index of a handle.
struct FreedVertex {
  int32_t vertex = 0;
  int region = ConstraintSet::kFixed;

  friend bool operator==(const FreedVertex&, const FreedVertex&) = default;
};

// Whether the plan has contact rows, and what became of them.
enum class ContactUse {
  kNone,     // the plan has none
  kOn,       // they are those of the constraints
  kLeftOut,  // by choice: tissue sticks, and the lips are one piece
};

// A plan put upon its mesh: all that a deformer or a session needs, whether it was read from files
// (core/planning) or has just been built (core/planning/plan_building). Everything is in LPS,
// regardless of the plan's own coordinate system.
struct PlanProblem {
  std::shared_ptr<const TetMesh> mesh;
  std::vector<Attribute> point_data;  // of the mesh file, kept for the result
  std::vector<Attribute> cell_data;
  CoordinateSystem written_in = CoordinateSystem::kLps;  // in which results are written back
  Eigen::VectorXd stiffness;                             // #T, Pa
  ConstraintSet constraints;
  std::vector<HandlePose> poses;  // one per handle of `constraints`
  ContactUse contact_use = ContactUse::kNone;
  std::optional<LipEdge> lip_edge = {};  // that a seal may close; only with contact
  std::vector<FreedVertex> freed = {};   // by vertex, rising
  DeformerOptions deformer;
  std::optional<MaterialUncertainty> uncertainty;  // what the plan says is not known
};

// The regions to which tissue would stick without contact: what the plan's selectors select.
ConstraintSet StickingRegions(const PlanProblem& problem);

}  // namespace tissueform
