// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/releasable_models.h"

#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/memory/memory.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/handle_targets.h"
#include "core/mechanics/deformation/poisson_reconstruction.h"
#include "core/mechanics/deformation/rotation_propagation.h"
#include "core/mechanics/elasticity/elastic_stiffness.h"
#include "core/mechanics/elasticity/material.h"
#include "core/mesh/operators/laplacian.h"
#include "core/mesh/validation.h"

namespace tissueform {
namespace {

// So many unknowns that are released at once are about as dear as a new factor without them.
// (Measured with heads of 25,000 and 36,000 vertices.) Those that were released before cost nothing
// again but their place in the dense Schur complement, whose factor takes a hundredth of a second
// at the most.
constexpr Eigen::Index kMaxReleasedAtOnce = 120;
constexpr Eigen::Index kMaxReleased = 600;

absl::Status Prepare(const std::vector<int32_t>& prescribed, int unknowns_per_node,
                     absl::FunctionRef<SparseMatrix()> assemble,
                     std::unique_ptr<ReleasableSystem>* system) {
  std::vector<int32_t> node_order;
  if (*system != nullptr) {
    const Eigen::Index ever = (*system)->num_released() + (*system)->num_prescribed();
    const auto kept = static_cast<Eigen::Index>(prescribed.size());
    if ((*system)->num_prescribed() - kept <= kMaxReleasedAtOnce && ever - kept <= kMaxReleased) {
      return (*system)->KeepOnly(prescribed);
    }
    node_order = (*system)->node_order();
    system->reset();
  }
  TF_ASSIGN_OR_RETURN(*system, ReleasableSystem::Create(assemble(), prescribed,
                                                        {.backend = CholeskyBackend::kCholmod,
                                                         .admission = {},
                                                         .unknowns_per_node = unknowns_per_node,
                                                         .node_order = std::move(node_order)}));
  return absl::OkStatus();
}

std::vector<int32_t> UnknownsOf(const std::vector<int32_t>& vertices) {
  std::vector<int32_t> unknowns;
  unknowns.reserve(3 * vertices.size());
  for (const int32_t v : vertices) {
    for (int axis = 0; axis < 3; ++axis) unknowns.push_back(3 * v + axis);
  }
  return unknowns;
}

// 1 on its own handle; see ComputeHarmonicFields.
Eigen::MatrixXd HarmonicValues(const ConstraintSet& constraints) {
  const std::vector<int>& regions = constraints.region_of_constrained();
  Eigen::MatrixXd values =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(regions.size()),
                            static_cast<Eigen::Index>(constraints.handles().size()));
  for (size_t c = 0; c < regions.size(); ++c) {
    if (regions[c] != ConstraintSet::kFixed) values(static_cast<Eigen::Index>(c), regions[c]) = 1;
  }
  return values;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ReleasableModels>> ReleasableModels::Create(
    const TetMesh& mesh, const Eigen::VectorXd& stiffness, double poisson_ratio, int threads) {
  TF_RETURN_IF_ERROR(CheckPoissonRatio(poisson_ratio));
  TF_RETURN_IF_ERROR(CheckTetMesh(mesh));
  TF_RETURN_IF_ERROR(CheckStiffness(mesh.num_tets(), stiffness, "tet"));
  return absl::WrapUnique(new ReleasableModels(mesh, stiffness, poisson_ratio, threads));
}

ReleasableModels::ReleasableModels(const TetMesh& mesh, Eigen::VectorXd stiffness,
                                   double poisson_ratio, int threads)
    : mesh_(mesh),
      stiffness_(std::move(stiffness)),
      poisson_ratio_(poisson_ratio),
      threads_(threads),
      elements_(ElementsOf(mesh_)),
      vertex_cells_(elements_.cells, elements_.num_vertices()) {}

absl::StatusOr<std::vector<Positions>> ReleasableModels::GradientField(
    const ConstraintSet& constraints, PoseSets pose_sets) {
  TF_RETURN_IF_ERROR(Prepare(
      constraints.constrained(), 1, [&] { return CotangentLaplacian(mesh_, stiffness_, threads_); },
      &laplacian_));
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd harmonic,
                      laplacian_->Solve({}, HarmonicValues(constraints)));
  // All sets at once: the time goes into reading the factor.
  std::vector<HandleTargets> targets;
  const auto columns = static_cast<Eigen::Index>(3 * pose_sets.size());
  Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(elements_.num_vertices(), columns);
  Eigen::MatrixXd values(static_cast<Eigen::Index>(constraints.constrained().size()), columns);
  CellTransforms transforms;
  for (const std::vector<HandlePose>& poses : pose_sets) {
    const auto column = static_cast<Eigen::Index>(3 * targets.size());
    targets.push_back(MakeHandleTargets(constraints, elements_.rest, poses));
    PropagateRotations(elements_, harmonic, poses, threads_, &transforms);
    TransformsToCornerLoads(elements_, stiffness_, threads_, &transforms);
    // Without rows where nothing turns.
    const Eigen::MatrixXd of_set =
        GatherCornerLoads(vertex_cells_, elements_.num_vertices(), transforms, threads_);
    if (of_set.rows() > 0) loads.middleCols<3>(column) = of_set;
    values.middleCols<3>(column) = targets.back().displacements;
  }
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd displacements, laplacian_->Solve(loads, values));
  std::vector<Positions> answers;
  for (size_t i = 0; i < targets.size(); ++i) {
    answers.push_back(ToPositions(constraints, elements_.rest,
                                  displacements.middleCols<3>(static_cast<Eigen::Index>(3 * i)),
                                  targets[i]));
  }
  return answers;
}

absl::StatusOr<std::vector<Positions>> ReleasableModels::LinearElastic(
    const ConstraintSet& constraints, PoseSets pose_sets) {
  TF_RETURN_IF_ERROR(Prepare(
      UnknownsOf(constraints.constrained()), 3,
      [&] {
        return ElasticStiffness(elements_, vertex_cells_, stiffness_, poisson_ratio_, threads_);
      },
      &elastic_));
  std::vector<HandleTargets> targets;
  Eigen::MatrixXd values(static_cast<Eigen::Index>(3 * constraints.constrained().size()),
                         static_cast<Eigen::Index>(pose_sets.size()));
  for (const std::vector<HandlePose>& poses : pose_sets) {
    targets.push_back(MakeHandleTargets(constraints, elements_.rest, poses));
    values.col(static_cast<Eigen::Index>(targets.size()) - 1) = Eigen::Map<const Eigen::VectorXd>(
        targets.back().displacements.data(), targets.back().displacements.size());
  }
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd displacements, elastic_->Solve({}, values));
  std::vector<Positions> answers;
  for (size_t i = 0; i < targets.size(); ++i) {
    const Eigen::MatrixXd by_vertex = Eigen::Map<const Positions>(
        displacements.col(static_cast<Eigen::Index>(i)).data(), elements_.num_vertices(), 3);
    answers.push_back(ToPositions(constraints, elements_.rest, by_vertex, targets[i]));
  }
  return answers;
}

}  // namespace tissueform
