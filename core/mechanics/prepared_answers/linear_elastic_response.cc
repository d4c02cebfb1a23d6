// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/linear_elastic_response.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/contact/lcp_solver.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/elastic_contact.h"
#include "core/mechanics/prepared_answers/chosen_vertices.h"
#include "core/mechanics/prepared_answers/compressed_columns.h"
#include "core/mechanics/prepared_answers/pose_samples.h"

namespace tissueform {
namespace {

// Of poses and of unilateral contact.
Eigen::Index NumColumns(const MeshPreparation& preparation) {
  const auto lifts_off = [](const ContactRow& row) { return !row.bilateral; };
  return ElasticSystem::kColumnsPerHandle *
             static_cast<Eigen::Index>(preparation.constraints().handles().size()) +
         std::ranges::count_if(preparation.constraints().contact(), lifts_off);
}

// Uses of the poses with the contact forces that they cause below them. A row that no pose presses
// gets the mean force of the others in one more use, so that its column is not given up.
Eigen::MatrixXd WithForces(const ElasticContact& contact, const Eigen::MatrixXd& uses) {
  const auto num_rows = static_cast<Eigen::Index>(contact.rows().size());
  LcpSolver solver({contact.compliance().data(), static_cast<size_t>(contact.compliance().size())},
                   contact.rows().size());
  Eigen::MatrixXd with = Eigen::MatrixXd::Zero(uses.rows() + num_rows, uses.cols() + 1);
  with.topLeftCorner(uses.rows(), uses.cols()) = uses;
  for (Eigen::Index use = 0; use < uses.cols(); ++use) {
    const Eigen::VectorXd gaps = contact.Gaps(uses.col(use));
    const LcpSolution& solution = solver.Solve({gaps.data(), contact.rows().size()});
    with.col(use).tail(num_rows) =
        Eigen::Map<const Eigen::VectorXd>(solution.multipliers.data(), num_rows);
  }
  const Eigen::VectorXd means = with.bottomRows(num_rows).rowwise().mean();
  with.col(uses.cols()).tail(num_rows) =
      (means.array() > 0).select(0.0, Eigen::VectorXd::Constant(num_rows, means.maxCoeff()));
  return with;
}

// Writes the contact of the answers, and gives columns and uses the parts of contact forces.
absl::Status AddContact(const ElasticContact& contact, const std::vector<int32_t>& free,
                        const Cancellation& cancellation, PortableAnswers* answers,
                        Eigen::MatrixXd* columns, ColumnWeights* uses) {
  const auto list = [](const auto& matrix) {
    return std::vector<double>(matrix.data(), matrix.data() + matrix.size());
  };
  answers->contact_gaps = list(contact.gaps_at_rest());
  answers->contact_gap_map = list(contact.gap_columns());
  answers->contact_compliance = list(contact.compliance());
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd of_forces, contact.ForceColumns(free, cancellation));
  Eigen::MatrixXd both(columns->rows(), columns->cols() + of_forces.cols());
  both << *columns, of_forces;
  *columns = std::move(both);
  uses->typical = WithForces(contact, uses->typical);
  uses->widest = WithForces(contact, uses->widest);
  return absl::OkStatus();
}

Eigen::MatrixXd CoefficientsOf(const ElasticSystem& elastic,
                               const std::vector<std::vector<HandlePose>>& samples) {
  Eigen::MatrixXd coefficients(elastic.response_columns().cols(),
                               static_cast<Eigen::Index>(samples.size()));
  for (size_t s = 0; s < samples.size(); ++s) {
    coefficients.col(static_cast<Eigen::Index>(s)) = elastic.Coefficients(samples[s]);
  }
  return coefficients;
}

}  // namespace

ColumnWeights ElasticUses(const MeshPreparation& preparation, const ElasticSystem& elastic,
                          double max_rotation_rad) {
  constexpr int kSamples = 400;
  const double size_mm = preparation.mesh().BoundingBoxDiagonal();
  const std::vector<Eigen::Vector3d> centroids = HandleCentroids(preparation);
  const PoseRange typical{.rotation_rad = 0.3 * max_rotation_rad,
                          .scale_change = 1e-3,  // bone keeps its size
                          .translation_mm = 0.05 * size_mm,
                          .pivot_offset_mm = 0.1 * size_mm};
  const PoseRange widest{.rotation_rad = max_rotation_rad,
                         .scale_change = 0.1,
                         .translation_mm = 0.15 * size_mm,
                         .pivot_offset_mm = 0.35 * size_mm};
  return {.factors = 1,
          .typical = CoefficientsOf(elastic, SamplePoses(centroids, typical, kSamples)),
          .widest = CoefficientsOf(elastic, SamplePoses(centroids, widest, kSamples))};
}

int64_t LinearElasticResponseBytes(const MeshPreparation& preparation, Eigen::Index num_vertices) {
  return CompressedColumnsBytes(num_vertices, ColumnRows::kCoordinates, NumColumns(preparation));
}

absl::StatusOr<std::unique_ptr<VertexResponse>> CreateLinearElasticResponse(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const LinearElasticResponseOptions& options, const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckTolerance(options.tolerance_mm));
  if (!std::isfinite(options.max_rotation_rad) || options.max_rotation_rad <= 0) {
    return absl::InvalidArgumentError(absl::StrCat("max_rotation_rad is ", options.max_rotation_rad,
                                                   "; it must be a positive number"));
  }
  TF_RETURN_IF_ERROR(CheckChosenVertices(vertices, preparation->mesh().num_vertices()));
  TF_RETURN_IF_ERROR(cancellation.Check());
  if (options.admission) {
    TF_RETURN_IF_ERROR(options.admission(
        LinearElasticResponseBytes(*preparation, static_cast<Eigen::Index>(vertices.size()))));
  }
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
  // Turned, not solved for: too short to be counted.
  TellProgress(options.observer, PreparationStage::kAnswers);
  const Positions& rest = preparation->mesh().positions();
  PortableAnswers answers;
  const std::vector<int32_t> free =
      DescribeVertices(rest, preparation->constraints(), vertices, &answers);
  answers.numbers.model = static_cast<double>(AnswerModel::kLinearElastic);
  answers.numbers.tolerance_mm = options.tolerance_mm;
  answers.numbers.max_rotation_rad = options.max_rotation_rad;
  answers.origins.assign(elastic->origin().begin(), elastic->origin().end());
  // Nothing is truncated: 12 columns make every affine motion of a handle.
  Eigen::MatrixXd columns = RowsOfVertices(elastic->response_columns(), free);
  ColumnWeights uses = ElasticUses(*preparation, *elastic, options.max_rotation_rad);
  TF_ASSIGN_OR_RETURN(const ElasticContact* contact, preparation->Contact(cancellation));
  if (!contact->rows().empty()) {
    TF_RETURN_IF_ERROR(AddContact(*contact, free, cancellation, &answers, &columns, &uses));
  }
  CompressColumns(rest(free, Eigen::all), ColumnRows::kCoordinates, columns, uses,
                  options.tolerance_mm, &answers);
  return std::make_unique<VertexResponse>(std::move(answers),
                                          static_cast<int>(NumColumns(*preparation)));
}

}  // namespace tissueform
