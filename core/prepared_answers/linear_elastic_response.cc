// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/linear_elastic_response.h"

#include <utility>

#include "core/base/status_macros.h"
#include "core/deformation/deformation_checks.h"
#include "core/prepared_answers/panel_response.h"

namespace tissueform {
namespace {

Eigen::Index NumColumns(const MeshPreparation& preparation) {
  return ElasticSystem::kColumnsPerHandle *
         static_cast<Eigen::Index>(preparation.constraints().handles().size());
}

class LinearElasticResponse : public VertexResponse {
 public:
  LinearElasticResponse(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic,
                        const std::vector<int32_t>& vertices, double tolerance_mm)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        tolerance_mm_(tolerance_mm),
        panel_(preparation_->mesh().positions()(vertices, Eigen::all),
               PanelResponse::Rows::kCoordinates, NumColumns(*preparation_)) {
    Eigen::VectorXd chosen(3 * panel_.num_vertices());
    for (Eigen::Index column = 0; column < panel_.num_columns(); ++column) {
      for (size_t i = 0; i < vertices.size(); ++i) {
        chosen.segment<3>(3 * static_cast<Eigen::Index>(i)) =
            elastic_.response_columns().col(column).segment<3>(3 * Eigen::Index{vertices[i]});
      }
      panel_.SetColumn(column, chosen);
    }
  }

  double ErrorBoundMm(absl::Span<const HandlePose> poses) const override {
    // Nothing is truncated: 12 columns make every affine motion of a handle.
    return panel_.Choose(elastic_.Coefficients(poses), tolerance_mm_).bound_mm;
  }

  bool Covers(absl::Span<const HandlePose> poses) const override {
    return ErrorBoundMm(poses) <= tolerance_mm_;
  }

  void Evaluate(absl::Span<const HandlePose> poses, FloatPositions* positions) const override {
    const Eigen::VectorXd coefficients = elastic_.Coefficients(poses);
    panel_.Evaluate(coefficients, panel_.Choose(coefficients, tolerance_mm_), positions);
  }

  std::optional<double> Answer(absl::Span<const HandlePose> poses,
                               FloatPositions* positions) const override {
    const Eigen::VectorXd coefficients = elastic_.Coefficients(poses);
    const PanelResponse::Reading reading = panel_.Choose(coefficients, tolerance_mm_);
    if (!(reading.bound_mm <= tolerance_mm_)) return std::nullopt;
    panel_.Evaluate(coefficients, reading, positions);
    return reading.bound_mm;
  }

  Eigen::Index num_vertices() const override { return panel_.num_vertices(); }
  int num_terms() const override { return static_cast<int>(panel_.num_columns()); }
  int64_t bytes_held() const override { return panel_.bytes_held(); }

 private:
  const std::shared_ptr<MeshPreparation> preparation_;  // owns elastic_
  const ElasticSystem& elastic_;
  const double tolerance_mm_;
  PanelResponse panel_;
};

}  // namespace

int64_t LinearElasticResponseBytes(const MeshPreparation& preparation, Eigen::Index num_vertices) {
  return PanelResponse::BytesNeeded(num_vertices, PanelResponse::Rows::kCoordinates,
                                    NumColumns(preparation));
}

absl::StatusOr<std::unique_ptr<VertexResponse>> CreateLinearElasticResponse(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const LinearElasticResponseOptions& options, const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckTolerance(options.tolerance_mm));
  TF_RETURN_IF_ERROR(CheckChosenVertices(vertices, preparation->mesh().num_vertices()));
  TF_RETURN_IF_ERROR(cancellation.Check());
  if (options.admission) {
    TF_RETURN_IF_ERROR(options.admission(
        LinearElasticResponseBytes(*preparation, static_cast<Eigen::Index>(vertices.size()))));
  }
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
  // Copied, not solved for: too short to be counted.
  TellProgress(options.observer, PreparationStage::kAnswers);
  return std::make_unique<LinearElasticResponse>(preparation, *elastic, vertices,
                                                 options.tolerance_mm);
}

}  // namespace tissueform
