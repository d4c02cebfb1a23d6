// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/create_response.h"

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/prepared_answers/linear_elastic_response.h"
#include "core/mechanics/prepared_answers/neo_hookean_response.h"
#include "core/mechanics/prepared_answers/response_basis.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<VertexResponse>> CreateResponse(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const ResponseOptions& options, const Cancellation& cancellation) {
  const ModelTraits& model = TraitsOf(options.model);
  if (!model.has_prepared_contact) {
    TF_RETURN_IF_ERROR(CheckWithoutContact(preparation->constraints(),
                                           absl::StrCat(model.name, " in prepared answers")));
  }
  TF_RETURN_IF_ERROR(CheckComputesSeal(options.model, options.seal));
  if (options.model == DeformationModel::kLinearElastic) {
    return CreateLinearElasticResponse(preparation, vertices,
                                       {.tolerance_mm = options.tolerance_mm,
                                        .max_rotation_rad = options.max_rotation_rad,
                                        .seal = options.seal,
                                        .admission = options.admission,
                                        .observer = options.observer},
                                       cancellation);
  }
  if (options.model == DeformationModel::kNeoHookean) {
    return CreateNeoHookeanResponse(preparation, vertices,
                                    {.tolerance_mm = options.tolerance_mm,
                                     .max_rotation_rad = options.max_rotation_rad,
                                     .max_estimate_mm = options.max_estimate_mm,
                                     .admission = options.admission,
                                     .observer = options.observer},
                                    cancellation);
  }
  return CreateResponseBasis(preparation, vertices,
                             {.tolerance_mm = options.tolerance_mm,
                              .max_rotation_rad = options.max_rotation_rad,
                              .max_scale_change = options.max_scale_change,
                              .admission = options.admission,
                              .observer = options.observer},
                             cancellation);
}

}  // namespace tissueform
