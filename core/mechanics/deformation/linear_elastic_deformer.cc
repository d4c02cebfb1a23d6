// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/linear_elastic_deformer.h"

#include <utility>

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/contact/lcp_solver.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/handle_targets.h"
#include "core/mechanics/deformation/lip_seal.h"

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

PreparationSummary SummaryOf(const MeshPreparation& preparation, const ElasticSystem& elastic) {
  const FactorizationSummary& factorization = elastic.system().factorization();
  return {.assemble_seconds = elastic.assemble_seconds(),
          .analyse_seconds = factorization.analyse_seconds,
          .factorise_seconds = factorization.factorise_seconds,
          .prepare_seconds = elastic.response_seconds(),
          .factor_bytes = factorization.factor_bytes,
          .bytes_held = preparation.bytes_held()};
}

class LinearElasticDeformer : public Deformer {
 public:
  LinearElasticDeformer(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        summary_(SummaryOf(*preparation_, elastic)) {
    displacements_.resize(elastic_.response_columns().rows());
    summary_.own_bytes = displacements_.size() * static_cast<int64_t>(sizeof(double));
    summary_.bytes_held += summary_.own_bytes;
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

std::span<const double> SpanOf(const auto& values) {
  return {values.data(), static_cast<size_t>(values.size())};
}

Eigen::Map<const Eigen::VectorXd> ForcesOf(const LcpSolution& solution) {
  return {solution.multipliers.data(), static_cast<Eigen::Index>(solution.multipliers.size())};
}

Deformation ToDeformation(const Positions& positions, const LcpSolution& solution) {
  Deformation deformation;
  deformation.positions = positions;
  deformation.contact = {.forces = solution.multipliers,
                         .gaps_mm = solution.gaps_mm,
                         .residual_mm = solution.kkt_residual_mm};
  deformation.summary.converged = solution.converged;
  return deformation;
}

// With unilateral contact rows.
class LinearContactDeformer : public Deformer {
 public:
  LinearContactDeformer(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic,
                        const ElasticContact& contact)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        contact_(contact),
        solver_(SpanOf(contact.compliance()), contact.rows().size()),
        summary_(SummaryOf(*preparation_, elastic)) {}

  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                     const DeformControl& /*control*/) override {
    TF_RETURN_IF_ERROR(CheckPoses(preparation_->constraints(), poses));
    const Stopwatch stopwatch;
    const Eigen::VectorXd coefficients = elastic_.Coefficients(poses);
    const Eigen::VectorXd gaps = contact_.Gaps(coefficients);
    const LcpSolution& solution = solver_.Solve(SpanOf(gaps));
    TF_ASSIGN_OR_RETURN(const Eigen::VectorXd pushed, contact_.Displacements(solution.multipliers));
    Deformation deformation = ToDeformation(
        ToPositions(*preparation_, elastic_.response_columns() * coefficients + pushed,
                    Targets(*preparation_, poses)),
        solution);
    deformation.summary.solve_seconds = stopwatch.Seconds();
    return deformation;
  }

  const PreparationSummary& preparation() const override { return summary_; }

 private:
  const std::shared_ptr<MeshPreparation> preparation_;  // owns the next two
  const ElasticSystem& elastic_;
  const ElasticContact& contact_;
  LcpSolver solver_;
  const PreparationSummary summary_;
};

// With contact rows and lips that are sealed.
class SealedLipsDeformer : public Deformer {
 public:
  SealedLipsDeformer(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic,
                     const ElasticContact& contact, std::unique_ptr<const LipSeal> seal)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        contact_(contact),
        seal_(std::move(seal)),
        free_solver_(SpanOf(contact.compliance()), contact.rows().size()),
        sealed_solver_(SpanOf(seal_->compliance()), contact.rows().size()),
        summary_(SummaryOf(*preparation_, elastic)) {}

  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                     const DeformControl& /*control*/) override {
    TF_RETURN_IF_ERROR(CheckPoses(preparation_->constraints(), poses));
    const Stopwatch stopwatch;
    const Eigen::VectorXd coefficients = elastic_.Coefficients(poses);
    const Eigen::VectorXd untouched = elastic_.response_columns() * coefficients;
    const Eigen::VectorXd gaps = contact_.Gaps(coefficients);
    const LcpSolution& free = free_solver_.Solve(SpanOf(gaps));
    TF_ASSIGN_OR_RETURN(const Eigen::VectorXd pushed, contact_.Displacements(free.multipliers));
    const Eigen::VectorXd parted = untouched + pushed;
    const Eigen::VectorXd heights = seal_->UpperHeights(parted);
    SealAnswer answer{.pairs = seal_->num_pairs(),
                      .parted_mm = (heights - seal_->LowerHeights(parted)).cwiseAbs().maxCoeff()};
    answer.released = answer.parted_mm > kSealReleaseMm;
    const Positions targets = Targets(*preparation_, poses);
    Deformation deformation;
    if (answer.released) {
      deformation = ToDeformation(ToPositions(*preparation_, parted, targets), free);
    } else {
      const Eigen::VectorXd raise = heights - seal_->LowerHeights(untouched);
      const Eigen::VectorXd sealed_gaps = seal_->Gaps(gaps, raise);
      const LcpSolution& sealed = sealed_solver_.Solve(SpanOf(sealed_gaps));
      TF_ASSIGN_OR_RETURN(const Eigen::VectorXd held,
                          seal_->Displacements(raise, ForcesOf(sealed)));
      deformation = ToDeformation(ToPositions(*preparation_, untouched + held, targets), sealed);
      deformation.summary.converged = free.converged && sealed.converged;
    }
    deformation.seal = answer;
    deformation.summary.solve_seconds = stopwatch.Seconds();
    return deformation;
  }

  const PreparationSummary& preparation() const override { return summary_; }

 private:
  const std::shared_ptr<MeshPreparation> preparation_;  // owns the next two
  const ElasticSystem& elastic_;
  const ElasticContact& contact_;
  const std::unique_ptr<const LipSeal> seal_;
  LcpSolver free_solver_;
  LcpSolver sealed_solver_;
  const PreparationSummary summary_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Deformer>> CreateLinearElasticDeformer(
    std::shared_ptr<MeshPreparation> preparation, const Cancellation& cancellation) {
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
  TF_ASSIGN_OR_RETURN(const ElasticContact* contact, preparation->Contact(cancellation));
  if (!contact->rows().empty()) {
    return std::make_unique<LinearContactDeformer>(std::move(preparation), *elastic, *contact);
  }
  return std::make_unique<LinearElasticDeformer>(std::move(preparation), *elastic);
}

absl::StatusOr<std::unique_ptr<Deformer>> CreateSealedLipsDeformer(
    std::shared_ptr<MeshPreparation> preparation, const LipEdge& edge,
    const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(
      CheckLipEdge(edge, preparation->mesh().positions(), preparation->constraints().contact()));
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
  TF_ASSIGN_OR_RETURN(const ElasticContact* contact, preparation->Contact(cancellation));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<const LipSeal> seal,
                      LipSeal::Create(edge, *contact, cancellation));
  return std::make_unique<SealedLipsDeformer>(std::move(preparation), *elastic, *contact,
                                              std::move(seal));
}

absl::StatusOr<Deformation> SolveLinearElasticDirectly(MeshPreparation* preparation,
                                                       absl::Span<const HandlePose> poses) {
  TF_RETURN_IF_ERROR(CheckWithoutContact(preparation->constraints(), "the direct solve"));
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
