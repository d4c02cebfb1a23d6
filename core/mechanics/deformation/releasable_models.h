// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/linear_solvers/releasable_system.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// The two models that answer without iterating, on one mesh, while its constraints become fewer:
// what a search for the right constraints asks. Each has one factor, made when it is first asked;
// vertices that are released afterwards cost a back-substitution or three. Answers are those of the
// deformers up to rounding.
//
// The two may be asked at the same time, by two threads; one model by one at a time.
class ReleasableModels {
 public:
  // `stiffness` is Young's modulus per tet in Pa, #T. Keeps the mesh.
  // Errors: InvalidArgument (a mesh that is not usable, stiffness or Poisson's ratio out of range).
  static absl::StatusOr<std::unique_ptr<ReleasableModels>> Create(const TetMesh& mesh,
                                                                  const Eigen::VectorXd& stiffness,
                                                                  double poisson_ratio,
                                                                  int threads);

  // Positions, #V by 3 in mm, for each of some sets of poses, with one pose a handle.
  // REQUIRES: `constraints` are those of the model's last call, or without some of their vertices,
  // and hold every component of the mesh; the handles stay in number and order.
  // Errors: those of DirichletSystem::Create and ReleasableSystem::KeepOnly.
  using PoseSets = absl::Span<const std::vector<HandlePose>>;
  absl::StatusOr<std::vector<Positions>> GradientField(const ConstraintSet& constraints,
                                                       PoseSets pose_sets);
  absl::StatusOr<std::vector<Positions>> LinearElastic(const ConstraintSet& constraints,
                                                       PoseSets pose_sets);

 private:
  ReleasableModels(const TetMesh& mesh, Eigen::VectorXd stiffness, double poisson_ratio,
                   int threads);

  // Constant after Create.
  const TetMesh mesh_;
  const Eigen::VectorXd stiffness_;
  const double poisson_ratio_;
  const int threads_;
  const PiecewiseLinearElements elements_;
  const VertexCells vertex_cells_;

  // Null until asked for.
  std::unique_ptr<ReleasableSystem> laplacian_;
  std::unique_ptr<ReleasableSystem> elastic_;
};

}  // namespace tissueform
