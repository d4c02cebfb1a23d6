// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/elastic_system.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/elasticity/elastic_stiffness.h"
#include "core/mechanics/elasticity/material.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {
namespace {

// Power iteration on the matrix and on its inverse. Three steps are enough to estimate the
// condition number to a factor of a few, and a limit for double precision needs no more; each step
// on the inverse costs a back-substitution.
constexpr int kConditionIterations = 3;

// The three unknowns of every constrained vertex, rising.
std::vector<int32_t> ConstrainedUnknowns(const ConstraintSet& constraints) {
  std::vector<int32_t> unknowns;
  unknowns.reserve(3 * constraints.constrained().size());
  for (const int32_t vertex : constraints.constrained()) {
    for (int axis = 0; axis < 3; ++axis) {
      unknowns.push_back(3 * vertex + axis);
    }
  }
  return unknowns;
}

// How much stiffer the material is against changes of volume than against shear. Beside the one the
// other is lost in the rounding of the matrix's entries, also where the mesh locks, so that the
// matrix itself looks sound.
double VolumeToShear(double poisson_ratio) {
  const ElasticModuli moduli = ModuliOf(1.0, poisson_ratio);
  return moduli.bulk / moduli.shear;
}

absl::Status CheckCondition(double condition, double poisson_ratio) {
  if (condition <= ElasticSystem::kLargestCondition) {
    return absl::OkStatus();
  }
  if (!std::isfinite(condition)) {
    return absl::InvalidArgumentError(
        "elastic system cannot be computed: the stiffness is too large or too small for double "
        "precision; give it in Pa");
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "elastic system is too ill-conditioned for a reliable answer (condition estimate ", condition,
      ", limit ", ElasticSystem::kLargestCondition, ") with Poisson's ratio ",
      absl::StrFormat("%.15g", poisson_ratio),
      "; use a ratio further below 0.5, or a narrower range of stiffness"));
}

// Prescribed displacements of the 12 affine motions of a handle, 3 #constrained by 12.
Eigen::MatrixXd AffineMotions(const TetMesh& mesh, const ConstraintSet& constraints, int handle,
                              const Eigen::Vector3d& origin) {
  const auto& vertices = constraints.constrained();
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(3 * static_cast<Eigen::Index>(vertices.size()),
                                                 ElasticSystem::kColumnsPerHandle);
  for (size_t c = 0; c < vertices.size(); ++c) {
    if (constraints.region_of_constrained()[c] == handle) {
      Eigen::RowVector4d x;
      x << mesh.positions().row(vertices[c]) - origin.transpose(), 1.0;
      for (int axis = 0; axis < 3; ++axis) {
        values.block<1, 4>(3 * static_cast<Eigen::Index>(c) + axis, 4 * axis) = x;
      }
    }
  }
  return values;
}

// The displacements along the normals of the held unknowns (#held by 12) in the same motions.
Eigen::MatrixXd SlidingMotions(const TetMesh& mesh, const ConstraintSet& constraints,
                               const SlidingBasis& sliding, int handle,
                               const Eigen::Vector3d& origin) {
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(sliding.held().size()),
                                                 ElasticSystem::kColumnsPerHandle);
  for (Eigen::Index held = 0; held < values.rows(); ++held) {
    const int32_t number = sliding.held()[static_cast<size_t>(held)].row;
    const ContactRow& row = constraints.contact()[static_cast<size_t>(number)];
    if (row.handle == handle) {
      values.row(held) =
          ElasticSystem::AffineMotionAlong(row.normal, mesh.positions().row(row.vertex), origin);
    }
  }
  return values;
}

}  // namespace

Eigen::Matrix<double, 1, ElasticSystem::kColumnsPerHandle> ElasticSystem::AffineMotionAlong(
    const Eigen::Vector3d& normal, const Eigen::RowVector3d& place, const Eigen::Vector3d& origin) {
  Eigen::RowVector4d x;
  x << place - origin.transpose(), 1.0;
  Eigen::Matrix<double, 1, kColumnsPerHandle> motion;
  for (int axis = 0; axis < 3; ++axis) motion.segment<4>(4 * axis) = normal[axis] * x;
  return motion;
}

absl::StatusOr<std::unique_ptr<ElasticSystem>> ElasticSystem::Create(
    const TetMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
    const ElasticSystemOptions& options, const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckPoissonRatio(options.poisson_ratio));
  auto elastic =
      absl::WrapUnique(new ElasticSystem(SlidingBasis(constraints, mesh.num_vertices())));
  // Affine motions are taken about the middle of the mesh. About zero, which may lie far outside it
  // in a scanner's coordinates, a small turn would be the difference of two large columns.
  elastic->origin_ =
      0.5 * (mesh.positions().colwise().minCoeff() + mesh.positions().colwise().maxCoeff());
  ReportProgress(options.observer, PreparationStage::kAssembling);
  Stopwatch stopwatch;
  {
    const PiecewiseLinearElements elements = ElementsOf(mesh);
    const VertexCells vertex_cells(elements.cells, elements.num_vertices());
    const SparseMatrix K =
        ElasticStiffness(elements, vertex_cells, stiffness, options.poisson_ratio, options.threads);
    elastic->assemble_seconds_ = stopwatch.Seconds();
    TF_RETURN_IF_ERROR(elastic->Factorize(K, constraints, options, cancellation));
  }
  TF_ASSIGN_OR_RETURN(const double of_system,
                      elastic->system_->EstimateCondition(kConditionIterations));
  elastic->condition_estimate_ = std::max(of_system, VolumeToShear(options.poisson_ratio));
  TF_RETURN_IF_ERROR(CheckCondition(elastic->condition_estimate_, options.poisson_ratio));
  stopwatch.Restart();
  TF_RETURN_IF_ERROR(elastic->PrepareResponses(mesh, constraints, options, cancellation));
  elastic->response_seconds_ = stopwatch.Seconds();
  return elastic;
}

absl::Status ElasticSystem::Factorize(const SparseMatrix& K, const ConstraintSet& constraints,
                                      const ElasticSystemOptions& options,
                                      const Cancellation& cancellation) {
  if (!sliding_.empty()) {
    // Turned vertices stay whole nodes of the factor: their held unknowns are left in it, alone.
    held_ = HoldUnknowns(sliding_.Turn(K), sliding_.held());
  }
  TF_ASSIGN_OR_RETURN(system_, DirichletSystem::Create(sliding_.empty() ? K : held_.matrix,
                                                       ConstrainedUnknowns(constraints),
                                                       {.backend = options.backend,
                                                        .admission = options.admission,
                                                        .unknowns_per_node = 3,
                                                        .node_order = options.node_order,
                                                        .observer = options.observer},
                                                       cancellation));
  held_.matrix = SparseMatrix();
  return absl::OkStatus();
}

absl::StatusOr<Eigen::MatrixXd> ElasticSystem::Solve(const Eigen::MatrixXd& forces,
                                                     const Eigen::MatrixXd& values,
                                                     const Eigen::MatrixXd& sliding) const {
  if (sliding_.empty()) return system_->Solve(forces, values);
  Eigen::MatrixXd rhs = forces;
  if (rhs.rows() == 0) rhs = Eigen::MatrixXd::Zero(response_columns_.rows(), values.cols());
  sliding_.ToTurned(&rhs);
  Eigen::MatrixXd along_normals = sliding;
  if (sliding.rows() == 0)
    along_normals =
        Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(sliding_.held().size()), values.cols());
  PrescribeHeld(held_, sliding_.held(), along_normals, &rhs);
  TF_ASSIGN_OR_RETURN(Eigen::MatrixXd displacements, system_->Solve(rhs, values));
  sliding_.FromTurned(&displacements);
  return displacements;
}

absl::Status ElasticSystem::PrepareResponses(const TetMesh& mesh, const ConstraintSet& constraints,
                                             const ElasticSystemOptions& options,
                                             const Cancellation& cancellation) {
  const Eigen::Index rows = 3 * mesh.num_vertices();
  const auto handles = static_cast<int>(constraints.handles().size());
  const int columns = kColumnsPerHandle * handles;
  if (options.admission) {
    TF_RETURN_IF_ERROR(options.admission(rows * columns * static_cast<int64_t>(sizeof(double))));
  }
  response_columns_.resize(rows, columns);
  // Handle by handle: 12 right-hand sides make one pass over the factor worth its reading, and all
  // handles at once would need their right-hand sides beside the columns.
  for (int h = 0; h < handles; ++h) {
    TF_RETURN_IF_ERROR(cancellation.Check());
    ReportProgress(options.observer, PreparationStage::kResponses, int64_t{kColumnsPerHandle} * h,
                   columns);
    TF_ASSIGN_OR_RETURN(
        response_columns_.middleCols(Eigen::Index{kColumnsPerHandle} * h, kColumnsPerHandle),
        Solve({}, AffineMotions(mesh, constraints, h, origin_),
              SlidingMotions(mesh, constraints, sliding_, h, origin_)));
  }
  ReportProgress(options.observer, PreparationStage::kResponses, columns, columns);
  return absl::OkStatus();
}

Eigen::VectorXd ElasticSystem::Coefficients(absl::Span<const HandlePose> poses) const {
  Eigen::VectorXd coefficients(kColumnsPerHandle * static_cast<Eigen::Index>(poses.size()));
  for (size_t h = 0; h < poses.size(); ++h) {
    const HandlePose& pose = poses[h];
    const Eigen::Matrix3d change =
        pose.scale * RotationMatrix(pose.rotation_vector) - Eigen::Matrix3d::Identity();
    const Eigen::Vector3d shift = change * (origin_ - pose.pivot_mm) + pose.translation_mm;
    for (int axis = 0; axis < 3; ++axis) {
      coefficients.segment<4>(kColumnsPerHandle * static_cast<Eigen::Index>(h) + 4 * axis)
          << change.row(axis).transpose(),
          shift[axis];
    }
  }
  return coefficients;
}

absl::StatusOr<const SinglePrecisionSolver*> ElasticSystem::Rounded(
    const FactorAdmission& admission) {
  if (rounded_ == nullptr) {
    if (admission) {
      TF_RETURN_IF_ERROR(admission(system_->single_precision_bytes()));
    }
    TF_ASSIGN_OR_RETURN(rounded_, system_->FreeInSinglePrecision());
  }
  return rounded_.get();
}

int64_t ElasticSystem::bytes_held() const {
  return system_->bytes_held() + held_.columns.nonZeros() * static_cast<int64_t>(16) +
         (rounded_ != nullptr ? system_->single_precision_bytes() : 0) +
         response_columns_.size() * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
