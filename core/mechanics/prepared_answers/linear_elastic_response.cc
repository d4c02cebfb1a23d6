// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/linear_elastic_response.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/prepared_answers/chosen_vertices.h"
#include "core/mechanics/prepared_answers/compressed_response.h"
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

class LinearElasticResponse : public VertexResponse {
 public:
  LinearElasticResponse(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic,
                        ChosenVertices chosen, const std::vector<int32_t>& free,
                        const LinearElasticResponseOptions& options)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        tolerance_mm_(options.tolerance_mm),
        max_rotation_rad_(options.max_rotation_rad),
        chosen_(std::move(chosen)),
        panel_(preparation_->mesh().positions()(free, Eigen::all),
               CompressedResponse::Rows::kCoordinates,
               RowsOfVertices(elastic_.response_columns(), free),
               ElasticUses(*preparation_, elastic_, options.max_rotation_rad),
               options.tolerance_mm) {}

  double ErrorBoundMm(absl::Span<const HandlePose> poses) const override {
    return BoundMm(poses, Choose(poses));
  }

  bool Covers(absl::Span<const HandlePose> poses) const override {
    return ErrorBoundMm(poses) <= tolerance_mm_;
  }

  void Evaluate(absl::Span<const HandlePose> poses, FloatPositions* positions) const override {
    Write(poses, Choose(poses), positions);
  }

  std::optional<double> Answer(absl::Span<const HandlePose> poses,
                               FloatPositions* positions) const override {
    const CompressedResponse::EvaluationPlan reading = Choose(poses);
    const double bound_mm = BoundMm(poses, reading);
    if (!(bound_mm <= tolerance_mm_)) return std::nullopt;
    Write(poses, reading, positions);
    return bound_mm;
  }

  PortableAnswers Describe() const override {
    PortableAnswers answers;
    chosen_.Describe(&answers);
    panel_.Describe(&answers);
    answers.numbers.model = static_cast<double>(AnswerModel::kLinearElastic);
    answers.numbers.tolerance_mm = tolerance_mm_;
    answers.numbers.max_rotation_rad = max_rotation_rad_;
    answers.origins.assign(elastic_.origin().begin(), elastic_.origin().end());
    return answers;
  }

  Eigen::Index num_vertices() const override { return chosen_.size(); }
  int num_terms() const override { return static_cast<int>(panel_.num_columns()); }
  int num_terms_before() const override { return static_cast<int>(panel_.num_columns_before()); }
  int64_t bytes_held() const override { return panel_.bytes_held() + chosen_.bytes_held(); }

 private:
  // Nothing is truncated: 12 columns make every affine motion of a handle.
  CompressedResponse::EvaluationPlan Choose(absl::Span<const HandlePose> poses) const {
    return panel_.Choose(elastic_.Coefficients(poses), tolerance_mm_);
  }
  double BoundMm(absl::Span<const HandlePose> poses,
                 const CompressedResponse::EvaluationPlan& reading) const {
    return std::max(reading.bound_mm, chosen_.RoundingBoundMm(poses));
  }
  void Write(absl::Span<const HandlePose> poses, const CompressedResponse::EvaluationPlan& reading,
             FloatPositions* positions) const {
    positions->resize(chosen_.size(), 3);
    panel_.Evaluate(reading, positions);
    chosen_.Complete(poses, positions);
  }

  const std::shared_ptr<MeshPreparation> preparation_;  // owns elastic_
  const ElasticSystem& elastic_;
  const double tolerance_mm_;
  const double max_rotation_rad_;
  const ChosenVertices chosen_;
  const CompressedResponse panel_;  // of the free ones
};

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
  return CompressedResponse::BytesNeeded(num_vertices, CompressedResponse::Rows::kCoordinates,
                                         NumColumns(preparation));
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
  ChosenVertices chosen(preparation->mesh().positions(), preparation->constraints(), vertices);
  const std::vector<int32_t> free = chosen.FreeAmong(vertices);
  return std::make_unique<LinearElasticResponse>(preparation, *elastic, std::move(chosen), free,
                                                 options);
}

}  // namespace tissueform
