// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include <Eigen/Core>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/plan_fitting/fit_request.h"
#include "core/mechanics/plan_fitting/skin_points.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// One number of a pose that is to be found.
struct FitUnknown {
  size_t handle = 0;
  bool is_rotation = false;
  int axis = 0;
  // In the axes of the request: the pose's component in LPS is `sign` times it. Radians or mm.
  double sign = 1;
  double lower = 0;
  double upper = 0;
};

// A target upon its mesh, LPS.
struct FitTarget {
  std::string name;
  MeshPoint point;
  Eigen::Vector3d rest_mm = Eigen::Vector3d::Zero();
  // What is looked at of its displacement: a row for the unit direction, or three.
  Eigen::Matrix<double, Eigen::Dynamic, 3> along;
  Eigen::VectorXd wanted_mm;  // a number for every row
  double weight = 1;
  double off_skin_mm = 0;  // how far the point was given from the skin
};

// A request put upon a mesh and a plan, LPS.
struct FitProblem {
  CoordinateSystem axes = CoordinateSystem::kLps;
  std::vector<FitTarget> targets;
  std::vector<FitUnknown> unknowns;
  std::vector<HandlePose> poses;  // of all handles: where the search starts, and what stays
  std::vector<std::string> handle_names;
  bool symmetric = false;
  double less_movement = 0;
  double tolerance_mm = 0;

  Eigen::Index num_equations() const;
};

// "mandible rotation_x_deg", in the axes of the request.
std::string UnknownName(const FitProblem& problem, const FitUnknown& unknown);

// `boundary`: BoundaryFacets(mesh), for who asks often.
//
// A moving handle turns about the request's pivot, or about the middle of its vertices: then its
// translation is how that middle moves. Its pose in the plan is written for that pivot, and is the
// same movement.
//
// Errors: those of CheckFitRequest; InvalidArgument, in one line that names the target or the
// handle: a point off the skin (by how much, in the tissue or outside it, and where the nearest
// skin is); a vertex or a handle that does not exist; nothing that may move, or more than
// kMaxFitUnknowns.
absl::StatusOr<FitProblem> ResolveFit(const FitRequest& request, const TetMesh& mesh,
                                      const TriangleIndices& boundary,
                                      const ConstraintSet& constraints,
                                      absl::Span<const HandlePose> poses);
absl::StatusOr<FitProblem> ResolveFit(const FitRequest& request, const TetMesh& mesh,
                                      const ConstraintSet& constraints,
                                      absl::Span<const HandlePose> poses);

}  // namespace tissueform
