// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/linear_elastic_response.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/prepared_answers/chosen_vertices.h"
#include "core/mechanics/prepared_answers/compressed_columns.h"
#include "core/mechanics/prepared_answers/pose_samples.h"

namespace tissueform {
namespace {

Eigen::Index NumColumns(const MeshPreparation& preparation) {
  return ElasticSystem::kColumnsPerHandle *
         static_cast<Eigen::Index>(preparation.constraints().handles().size());
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
  CompressColumns(rest(free, Eigen::all), ColumnRows::kCoordinates,
                  RowsOfVertices(elastic->response_columns(), free),
                  ElasticUses(*preparation, *elastic, options.max_rotation_rad),
                  options.tolerance_mm, &answers);
  return std::make_unique<VertexResponse>(std::move(answers),
                                          static_cast<int>(NumColumns(*preparation)));
}

}  // namespace tissueform
