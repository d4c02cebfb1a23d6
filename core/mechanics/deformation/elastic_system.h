// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/sliding_basis.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

struct ElasticSystemOptions {
  double poisson_ratio = 0.45;  // in [0, 0.5)
  CholeskyBackend backend = CholeskyBackend::kCholmod;
  FactorAdmission admission;  // may be empty; called for the factor, then for the response columns
  int threads = 1;
  std::vector<int32_t> node_order = {};    // of the vertices, see DirichletSystem::Options
  PreparationObserver observer = nullptr;  // may be empty; also receives the response columns
};

// The stiffness matrix of linear elasticity with the constrained vertices eliminated and
// factorised, and the responses of the free vertices to 12 affine motions of every handle: what the
// linear model answers with, and what preconditions the non-linear one. What is const may be used
// by several threads at once.
//
// Bilateral contact rows of the constraint set hold here: their vertices slide on their bone.
// Unilateral rows are not looked at (ElasticContact).
//
// Unknowns are interleaved: 3 v + axis.
class ElasticSystem {
 public:
  // A condition estimate above this is refused: answers would have fewer than six digits.
  static constexpr double kLargestCondition = 1e10;
  static constexpr int kColumnsPerHandle = 12;

  // REQUIRES: every tet has positive volume; stiffness has one positive entry per tet.
  //
  // Errors: InvalidArgument (Poisson's ratio outside [0, 0.5), or so near 0.5 that the system is
  // unusable: said with the condition estimate), FailedPrecondition (not positive definite),
  // ResourceExhausted, Cancelled, or what the admission says.
  static absl::StatusOr<std::unique_ptr<ElasticSystem>> Create(
      const TetMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
      const ElasticSystemOptions& options, const Cancellation& cancellation = {});

  // Displacements, 3 #V by 12 #handles. Column 12 h + 4 i + j is the equilibrium when vertex v of
  // handle h is displaced by x_j(v) along axis i (x_j = x, y, z relative to origin(), and 1 for
  // j = 3) while all other constrained vertices rest, and all other bone that tissue slides on. A
  // pose of handle h whose affine map is v -> A (v - origin) + origin + b is the combination with
  // coefficients (A - I)_ij and b_i.
  const Eigen::MatrixXd& response_columns() const { return response_columns_; }
  const Eigen::Vector3d& origin() const { return origin_; }  // the middle of the mesh's box, mm

  // How far a bone at `place` moves along `normal` in each of its 12 motions.
  static Eigen::Matrix<double, 1, kColumnsPerHandle> AffineMotionAlong(
      const Eigen::Vector3d& normal, const Eigen::RowVector3d& place,
      const Eigen::Vector3d& origin);

  // The 12 #handles coefficients of poses.
  Eigen::VectorXd Coefficients(absl::Span<const HandlePose> poses) const;

  // K d = f with prescribed displacements, by back-substitution: `forces` 3 #V by k (or no rows)
  // and `values` 3 #constrained by k, both interleaved; `sliding` #held by k are the displacements
  // along the normals of sliding().held() (no rows: zero). Returns 3 #V by k.
  absl::StatusOr<Eigen::MatrixXd> Solve(const Eigen::MatrixXd& forces,
                                        const Eigen::MatrixXd& values,
                                        const Eigen::MatrixXd& sliding = {}) const;

  // What slides.
  const SlidingBasis& sliding() const { return sliding_; }

  // The factor in single precision, made when it is first asked for: as
  // DirichletSystem::FreeInSinglePrecision, with its errors. `admission`, which may be empty, is
  // asked for its bytes. The pointer lives as long as this object.
  absl::StatusOr<const SinglePrecisionSolver*> Rounded(const FactorAdmission& admission);

  // Its unknowns are those of sliding(): turned where tissue slides.
  const DirichletSystem& system() const { return *system_; }
  // The larger of the free block's (DirichletSystem::EstimateCondition) and the ratio of bulk to
  // shear modulus.
  double condition_estimate() const { return condition_estimate_; }
  double assemble_seconds() const { return assemble_seconds_; }
  double response_seconds() const { return response_seconds_; }
  int64_t bytes_held() const;

 private:
  explicit ElasticSystem(SlidingBasis sliding) : sliding_(std::move(sliding)) {}

  // Factorises K; where tissue slides, in turned unknowns.
  absl::Status Factorize(const SparseMatrix& K, const ConstraintSet& constraints,
                         const ElasticSystemOptions& options, const Cancellation& cancellation);
  absl::Status PrepareResponses(const TetMesh& mesh, const ConstraintSet& constraints,
                                const ElasticSystemOptions& options,
                                const Cancellation& cancellation);

  const SlidingBasis sliding_;
  HeldMatrix held_;  // without its matrix; empty where nothing slides
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Eigen::MatrixXd response_columns_;
  double condition_estimate_ = 0;
  double assemble_seconds_ = 0;
  double response_seconds_ = 0;
  std::unique_ptr<DirichletSystem> system_;
  std::unique_ptr<SinglePrecisionSolver> rounded_;  // null until asked for
};

}  // namespace tissueform
