// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

#include "core/mechanics/problem/plan_problem.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/planning/plan.h"

namespace tissueform {

// Largest plan file that is read.
inline constexpr size_t kMaxPlanBytes = size_t{16} << 20;

struct ResolveOptions {
  // Whether the plan's contact rows are used. Otherwise tissue sticks to all that the selectors
  // select, and the lips are one piece again (WeldSeam).
  bool contact = true;
  // Whether the lips are sealed, where the plan says how (Plan::lip_edge) and contact is used.
  bool seal = false;
};

struct PlanReadOptions {
  // Whether the mesh may lie outside the plan's folder. A plan comes from elsewhere more often than
  // not, and what it names ends up in results that go back there.
  bool allow_outside = false;
  // With which the plan is put upon its mesh afterwards; ReadPlan does not use them.
  ResolveOptions resolve = {};
};

// Reads and checks a plan file against the published schema, docs/plan.schema.json, which is built
// into the program, in the version that the file says.
//
// Errors: NotFound (no such file), InvalidArgument (not JSON, unknown key, wrong type, value out of
// range; the message names the key as a JSON pointer), PermissionDenied (the mesh, or the file that
// belongs to it, leaves the folder of the plan through "..", an absolute path or a symbolic link).
absl::StatusOr<Plan> ReadPlan(const std::string& path, const PlanReadOptions& options = {});

// The same for a text; `folder` is what the mesh path is relative to and `name` stands for the file
// in messages.
absl::StatusOr<Plan> ParsePlan(std::string_view json, const std::string& folder,
                               const std::string& name);

// Puts a plan upon its mesh: reads and validates the mesh file, looks up stiffness, resolves
// selectors, converts RAS to LPS.
//
// Errors: those of ReadTetMesh, CheckUsable and ConstraintSet::Create; InvalidArgument for a
// missing array, a value without stiffness, stiffness <= 0, an empty selection (the message names
// the handle or "fixed"), a mesh that is not the one of plan.mesh_sha256. A mesh that ends with
// ".tfcase" is that of a case; then also the errors of ReadCase. With contact rows also those of
// ResolveContact, ResolveLipEdge and WeldSeam.
absl::StatusOr<PlanProblem> ResolvePlan(const Plan& plan, const ResolveOptions& options = {});

// The same upon a mesh that is in memory, in the plan's own coordinate system: no file is read, and
// plan.mesh_path only stands for the mesh in messages.
absl::StatusOr<PlanProblem> ResolvePlan(const Plan& plan, TetMeshFile file,
                                        const ResolveOptions& options = {});

}  // namespace tissueform
