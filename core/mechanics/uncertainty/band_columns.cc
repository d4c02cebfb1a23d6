// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/band_columns.h"

#include <utility>

#include "absl/memory/memory.h"

#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/pose_range.h"
#include "core/mechanics/prepared_answers/column_compression.h"
#include "core/mechanics/prepared_answers/column_packing.h"
#include "core/mechanics/prepared_answers/linear_elastic_response.h"
#include "core/mechanics/uncertainty/material_expansion.h"
#include "core/mechanics/uncertainty/uncertainty_band.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<BandColumns>> BandColumns::Create(
    std::shared_ptr<MeshPreparation> preparation, const MaterialUncertainty& uncertainty,
    const std::vector<int32_t>& vertices, const FactorAdmission& admission,
    const Cancellation& cancellation) {
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
  const Eigen::MatrixXd& answers = elastic->response_columns();
  const auto rows = 3 * static_cast<Eigen::Index>(vertices.size());
  const auto variables = static_cast<Eigen::Index>(uncertainty.tissues.size()) +
                         (uncertainty.poisson_ratio_95 ? 1 : 0);
  if (admission) {
    // Of every variable forces and fields of all vertices; what is kept is small beside them.
    TF_RETURN_IF_ERROR(admission(variables * answers.cols() *
                                 (2 * answers.rows() * static_cast<int64_t>(sizeof(double)) +
                                  rows * static_cast<int64_t>(sizeof(float)))));
  }
  TF_ASSIGN_OR_RETURN(const AnswerExpansion expansion,
                      ExpandLinearElastic(preparation.get(), uncertainty, answers,
                                          ExpansionOrder::kFirst, cancellation));
  auto band = absl::WrapUnique(new BandColumns(std::move(preparation), *elastic));
  for (const AnswerExpansion::Term& term : expansion.terms) {
    Eigen::MatrixXf& columns = band->columns_.emplace_back(rows, answers.cols());
    for (size_t v = 0; v < vertices.size(); ++v) {
      columns.middleRows<3>(3 * static_cast<Eigen::Index>(v)) =
          term.field.middleRows<3>(3 * static_cast<Eigen::Index>(vertices[v])).cast<float>();
    }
  }
  return band;
}

void BandColumns::Evaluate(absl::Span<const HandlePose> poses, double max_rotation_rad,
                           Eigen::VectorXf* band_mm) const {
  band_mm->resize(0);
  for (const HandlePose& pose : poses) {
    if (!HasBand(pose.rotation_vector.norm(), max_rotation_rad)) return;
  }
  const Eigen::VectorXf coefficients = elastic_.Coefficients(poses).cast<float>();
  Eigen::MatrixXf fields(columns_.front().rows(), static_cast<Eigen::Index>(columns_.size()));
  for (size_t i = 0; i < columns_.size(); ++i) {
    fields.col(static_cast<Eigen::Index>(i)).noalias() = columns_[i] * coefficients;
  }
  *band_mm = FirstOrderBand(fields);
}

// One variable's rows below the other's: so that all of them share factors, and are compressed by
// what poses do to them together.
void BandColumns::Describe(PortableAnswers* answers) const {
  std::vector<Eigen::Index> rows;  // of free vertices
  for (size_t v = 0; v < answers->regions.size(); ++v) {
    if (answers->regions[v] != PortableAnswers::kFree) continue;
    for (size_t axis = 0; axis < 3; ++axis) rows.push_back(static_cast<Eigen::Index>(3 * v + axis));
  }
  const auto count = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd stacked(count * static_cast<Eigen::Index>(columns_.size()),
                          columns_.front().cols());
  for (size_t i = 0; i < columns_.size(); ++i) {
    stacked.middleRows(count * static_cast<Eigen::Index>(i), count) =
        columns_[i](rows, Eigen::all).cast<double>();
  }
  const ColumnCompression compression(
      stacked, 3, ElasticUses(*preparation_, elastic_, answers->numbers.max_rotation_rad),
      kBandTolerance * preparation_->mesh().BoundingBoxDiagonal());
  PortableAnswers compressed;
  compression.Describe(&compressed);
  answers->band_map = std::move(compressed.map);
  PackColumns(compression.kept(), 0, &answers->band);
}

int64_t BandColumns::bytes_held() const {
  int64_t bytes = 0;
  for (const Eigen::MatrixXf& columns : columns_) {
    bytes += columns.size() * static_cast<int64_t>(sizeof(float));
  }
  return bytes;
}

}  // namespace tissueform
