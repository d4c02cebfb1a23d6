// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/linear_elastic_response.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/contact_forces.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/elastic_contact.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/deformation/lip_seal.h"
#include "core/mechanics/prepared_answers/chosen_vertices.h"
#include "core/mechanics/prepared_answers/compressed_columns.h"
#include "core/mechanics/prepared_answers/pose_samples.h"

namespace tissueform {
namespace {

// Of poses, of unilateral contact and of a seal.
Eigen::Index NumColumns(const MeshPreparation& preparation, const std::optional<LipEdge>& seal) {
  const auto lifts_off = [](const ContactRow& row) { return !row.bilateral; };
  return ElasticSystem::kColumnsPerHandle *
             static_cast<Eigen::Index>(preparation.constraints().handles().size()) +
         std::ranges::count_if(preparation.constraints().contact(), lifts_off) +
         (seal ? static_cast<Eigen::Index>(seal->pairs.size()) : 0);
}

// Uses of the poses with the forces of contact and of the seal that they cause below them. A force
// that no pose causes gets the mean of the others in one more use, so that its column is not given
// up.
Eigen::MatrixXd WithForces(const PortableAnswers& answers, const Eigen::MatrixXd& uses) {
  const ContactForces contact(answers);
  const auto num_forces =
      static_cast<Eigen::Index>(answers.contact_gaps.size() + SealPairs(answers));
  Eigen::MatrixXd with = Eigen::MatrixXd::Zero(uses.rows() + num_forces, uses.cols() + 1);
  for (Eigen::Index use = 0; use < uses.cols(); ++use) {
    std::vector<double> factors(uses.col(use).begin(), uses.col(use).end());
    contact.Append(answers, &factors);
    with.col(use) = Eigen::Map<const Eigen::VectorXd>(factors.data(), with.rows());
  }
  const Eigen::VectorXd means =
      with.bottomLeftCorner(num_forces, uses.cols()).cwiseAbs().rowwise().sum() /
      static_cast<double>(with.cols());
  with.col(uses.cols()).tail(num_forces) =
      (means.array() > 0).select(0.0, Eigen::VectorXd::Constant(num_forces, means.maxCoeff()));
  return with;
}

template <typename Matrix>
std::vector<double> ListOf(const Matrix& matrix) {
  return {matrix.data(), matrix.data() + matrix.size()};
}

void Append(const Eigen::MatrixXd& more, Eigen::MatrixXd* columns) {
  Eigen::MatrixXd both(columns->rows(), columns->cols() + more.cols());
  both << *columns, more;
  *columns = std::move(both);
}

// Writes the contact of the answers, and gives columns the parts of contact forces.
absl::Status AddContact(const ElasticContact& contact, const std::vector<int32_t>& free,
                        const Cancellation& cancellation, PortableAnswers* answers,
                        Eigen::MatrixXd* columns) {
  answers->contact_gaps = ListOf(contact.gaps_at_rest());
  answers->contact_gap_map = ListOf(contact.gap_columns());
  answers->contact_compliance = ListOf(contact.compliance());
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd of_forces, contact.ForceColumns(free, cancellation));
  Append(of_forces, columns);
  return absl::OkStatus();
}

// Of responses at the edge's vertices, a vertex' coordinates in turn.
Eigen::MatrixXd HeightsOf(const Eigen::MatrixXd& responses, const Eigen::Vector3d& up) {
  Eigen::MatrixXd heights(responses.rows() / 3, responses.cols());
  for (Eigen::Index p = 0; p < heights.rows(); ++p) {
    heights.row(p) = up.transpose() * responses.middleRows(3 * p, 3);
  }
  return heights;
}

std::vector<int32_t> VerticesOf(const LipEdge& edge, int32_t LipEdge::Pair::*which) {
  std::vector<int32_t> vertices;
  for (const LipEdge::Pair& pair : edge.pairs) vertices.push_back(pair.*which);
  return vertices;
}

// Writes the seal of the answers, and gives columns the parts of its forces. REQUIRES: AddContact.
absl::Status AddSeal(const LipEdge& edge, const ElasticSystem& elastic,
                     const ElasticContact& contact, const std::vector<int32_t>& free,
                     const Cancellation& cancellation, PortableAnswers* answers,
                     Eigen::MatrixXd* columns) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<LipSeal> seal,
                      LipSeal::Create(edge, contact, cancellation));
  const std::vector<int32_t> upper = VerticesOf(edge, &LipEdge::Pair::upper);
  const std::vector<int32_t> lower = VerticesOf(edge, &LipEdge::Pair::lower);
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd on_upper, contact.ForceColumns(upper, cancellation));
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd on_lower, contact.ForceColumns(lower, cancellation));
  const Eigen::MatrixXd& of_poses = elastic.response_columns();
  answers->seal_upper_map = ListOf(HeightsOf(RowsOfVertices(of_poses, upper), edge.up));
  answers->seal_upper_forces = ListOf(HeightsOf(on_upper, edge.up));
  answers->seal_lower_map = ListOf(HeightsOf(RowsOfVertices(of_poses, lower), edge.up));
  answers->seal_lower_forces = ListOf(HeightsOf(on_lower, edge.up));
  answers->seal_stiffness = ListOf(seal->Stiffness());
  answers->seal_release = {kSealReleaseMm};
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd of_seal, seal->ForceColumns(free, cancellation));
  Append(of_seal, columns);
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

int64_t LinearElasticResponseBytes(const MeshPreparation& preparation,
                                   const std::optional<LipEdge>& seal, Eigen::Index num_vertices) {
  return CompressedColumnsBytes(num_vertices, ColumnRows::kCoordinates,
                                NumColumns(preparation, seal));
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
  if (options.seal) {
    TF_RETURN_IF_ERROR(CheckLipEdge(*options.seal, preparation->mesh().positions(),
                                    preparation->constraints().contact()));
  }
  TF_RETURN_IF_ERROR(cancellation.Check());
  if (options.admission) {
    TF_RETURN_IF_ERROR(options.admission(LinearElasticResponseBytes(
        *preparation, options.seal, static_cast<Eigen::Index>(vertices.size()))));
  }
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
  // Turned, not solved for: too short to be counted.
  ReportProgress(options.observer, PreparationStage::kAnswers);
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
    TF_RETURN_IF_ERROR(AddContact(*contact, free, cancellation, &answers, &columns));
    if (options.seal) {
      TF_RETURN_IF_ERROR(
          AddSeal(*options.seal, *elastic, *contact, free, cancellation, &answers, &columns));
    }
    uses.typical = WithForces(answers, uses.typical);
    uses.widest = WithForces(answers, uses.widest);
  }
  CompressColumns(rest(free, Eigen::all), ColumnRows::kCoordinates, columns, uses,
                  options.tolerance_mm, &answers);
  return std::make_unique<VertexResponse>(std::move(answers),
                                          static_cast<int>(NumColumns(*preparation, options.seal)));
}

}  // namespace tissueform
