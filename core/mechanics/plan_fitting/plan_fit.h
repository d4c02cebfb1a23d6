// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/base/cancellation.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/plan_fitting/fit_problem.h"
#include "core/mechanics/plan_fitting/fit_quality.h"
#include "core/mechanics/prepared_answers/vertex_response.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The vertices that the targets of a problem look at, rising: those for which answers are prepared.
std::vector<int32_t> FitVertices(const FitProblem& problem);

// How far the handles of a problem may turn, in rad, with the steps by which slopes are measured:
// for the prepared range. More than 0.
double LargestFitRotation(const FitProblem& problem);

struct FitOptions {
  // Null: answers as prepared are the last word. Otherwise what the prepared answers are off by at
  // the poses found is measured with it, laid upon the targets, and the search goes on, until that
  // changes nothing: so the poses fit this model and not its shadow.
  Deformer* full_model = nullptr;
  Cancellation cancellation;
};

struct FittedTarget {
  Eigen::VectorXd reached_mm;  // along the rows of the target
  double missed_mm = 0;        // length of what is left between wanted and reached
  // Where the point ends up, LPS.
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
};

struct FittedUnknown {
  double value = 0;  // in the axes of the request; rad or mm
  ActiveBound bound = ActiveBound::kNone;
  Determination determination;
};

struct PlanFit {
  std::vector<HandlePose> poses;        // of all handles, LPS
  std::vector<FittedUnknown> unknowns;  // as in the problem
  std::vector<FittedTarget> targets;
  std::vector<FitDirection> directions;
  std::vector<std::pair<size_t, size_t>> contradictions;  // of targets
  // Rms over the vertices of all moving handles, from rest, to first order.
  double movement_mm = 0;
  bool converged = false;
  int iterations = 0;  // of all searches together
  // Of the full model; without one verified is false.
  bool verified = false;
  bool model_converged = true;
  int model_answers = 0;           // how often it was asked
  std::optional<SealAnswer> seal;  // of its last answer, of lips that were asked to be sealed
  // How far the prepared answers lay from it, the largest of the targets' numbers.
  double prepared_error_mm = 0;
  double search_seconds = 0;  // without the full model
};

// Finds the unknowns of the problem. `response`: prepared answers at FitVertices, of the mesh and
// constraints that the problem was put upon.
//
// An unreachable target is not an error: the result reports it.
//
// Errors: those of the full model; Cancelled.
absl::StatusOr<PlanFit> FitPlan(const FitProblem& problem, const TetMesh& mesh,
                                const ConstraintSet& constraints, const VertexResponse& response,
                                const FitOptions& options);

}  // namespace tissueform
