// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/deformation/model.h"
#include "core/mechanics/prepared_answers/vertex_response.h"

namespace tissueform {

// The options of all prepared answers in one place, so that sessions and commands choose them in
// one way.
struct ResponseOptions {
  DeformationModel model = DeformationModel::kGradientField;
  double tolerance_mm = 0.01;
  double max_rotation_rad = 30.0 * std::numbers::pi / 180.0;
  double max_scale_change = 0.1;     // of gradient_field, |s - 1|
  double max_estimate_mm = 5;        // of neo_hookean
  std::optional<LipEdge> seal = {};  // of linear_elastic; others refuse it
  FactorAdmission admission = nullptr;
  PreparationObserver observer = nullptr;
};

// The one switch over prepared answers. REQUIRES: HasPreparedAnswers.
//
// Errors: those of CreateResponseBasis, CreateLinearElasticResponse, CreateNeoHookeanResponse;
// InvalidArgument where there are contact rows and the model has none in prepared answers, and
// those of CheckComputesSeal (create_deformer.h).
absl::StatusOr<std::unique_ptr<VertexResponse>> CreateResponse(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const ResponseOptions& options, const Cancellation& cancellation = {});

}  // namespace tissueform
