// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/linear_elastic_deformer.h"

#include <utility>

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/handle_targets.h"

namespace tissueform {
namespace {

// Rest positions plus interleaved displacements, the constrained vertices exactly at `targets`.
Positions ToPositions(const MeshPreparation& preparation,
                      const Eigen::Ref<const Eigen::VectorXd>& displacements,
                      const Positions& targets) {
  const Positions& rest = preparation.mesh().positions();
  Positions positions =
      rest + Eigen::Map<const Positions>(displacements.data(), rest.rows(), rest.cols());
  positions(preparation.constraints().constrained(), Eigen::all) = targets;
  return positions;
}

Positions Targets(const MeshPreparation& preparation, absl::Span<const HandlePose> poses) {
  return ConstrainedPositions(preparation.mesh().positions(), preparation.constraints(), poses);
}

class LinearElasticDeformer : public Deformer {
 public:
  LinearElasticDeformer(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic)
      : preparation_(std::move(preparation)), elastic_(elastic) {
    const FactorizationSummary& factorization = elastic_.system().factorization();
    summary_.assemble_seconds = elastic_.assemble_seconds();
    summary_.analyse_seconds = factorization.analyse_seconds;
    summary_.factorise_seconds = factorization.factorise_seconds;
    summary_.prepare_seconds = elastic_.response_seconds();
    summary_.factor_bytes = factorization.factor_bytes;
    displacements_.resize(elastic_.response_columns().rows());
    summary_.own_bytes = displacements_.size() * static_cast<int64_t>(sizeof(double));
    summary_.bytes_held = preparation_->bytes_held() + summary_.own_bytes;
  }

  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                     const DeformControl& /*control*/) override {
    TF_RETURN_IF_ERROR(CheckPoses(preparation_->constraints(), poses));
    const Stopwatch stopwatch;
    displacements_.noalias() = elastic_.response_columns() * elastic_.Coefficients(poses);
    Deformation deformation;
    deformation.positions =
        ToPositions(*preparation_, displacements_, Targets(*preparation_, poses));
    deformation.summary.solve_seconds = stopwatch.Seconds();
    return deformation;
  }

  const PreparationSummary& preparation() const override { return summary_; }

 private:
  const std::shared_ptr<MeshPreparation> preparation_;  // owns elastic_
  const ElasticSystem& elastic_;
  PreparationSummary summary_;

  Eigen::VectorXd displacements_;  // workspace
};

}  // namespace

absl::StatusOr<std::unique_ptr<Deformer>> CreateLinearElasticDeformer(
    std::shared_ptr<MeshPreparation> preparation, const Cancellation& cancellation) {
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
  return std::make_unique<LinearElasticDeformer>(std::move(preparation), *elastic);
}

absl::StatusOr<Deformation> SolveLinearElasticDirectly(MeshPreparation* preparation,
                                                       absl::Span<const HandlePose> poses) {
  TF_RETURN_IF_ERROR(CheckPoses(preparation->constraints(), poses));
  TF_ASSIGN_OR_RETURN(ElasticSystem * elastic, preparation->Elastic());
  const Stopwatch stopwatch;
  const Positions targets = Targets(*preparation, poses);
  const Positions values = targets - preparation->mesh().positions()(
                                         preparation->constraints().constrained(), Eigen::all);
  TF_ASSIGN_OR_RETURN(
      const Eigen::MatrixXd displacements,
      elastic->Solve({}, Eigen::Map<const Eigen::VectorXd>(values.data(), values.size())));
  Deformation deformation;
  deformation.positions = ToPositions(*preparation, displacements.col(0), targets);
  deformation.summary.residual = elastic->system().RelativeResidual({}, displacements);
  deformation.summary.solve_seconds = stopwatch.Seconds();
  return deformation;
}

}  // namespace tissueform
