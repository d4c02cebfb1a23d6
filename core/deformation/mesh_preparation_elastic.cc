// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/status_macros.h"
#include "core/deformation/mesh_preparation.h"

namespace tissueform {

absl::StatusOr<ElasticSystem*> MeshPreparation::Elastic(const Cancellation& cancellation) {
  if (elastic_ == nullptr) {
    TF_ASSIGN_OR_RETURN(elastic_, ElasticSystem::Create(mesh_, stiffness_, constraints_,
                                                        {options_.poisson_ratio, options_.backend,
                                                         options_.admission, options_.threads},
                                                        cancellation));
  }
  return elastic_.get();
}

int64_t MeshPreparation::bytes_held() const {
  return laplacian_bytes() + (elastic_ != nullptr ? elastic_->bytes_held() : 0);
}

}  // namespace tissueform
