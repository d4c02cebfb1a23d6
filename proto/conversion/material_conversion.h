// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mechanics/uncertainty/material_uncertainty.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {

// Names of tissues stay behind.
v1::MaterialRanges ToProto(const MaterialUncertainty& uncertainty);

// For a mesh with `num_tets` tets and its Poisson's ratio. Errors: InvalidArgument (not one tissue
// for each tet, an unknown tissue, an invalid range).
absl::StatusOr<MaterialUncertainty> ToMaterialUncertainty(const v1::MaterialRanges& proto,
                                                          Eigen::Index num_tets,
                                                          double poisson_ratio);

// DeformFrame.uncertainty_p95_mm, and back. Errors: InvalidArgument when there are not so many.
std::string FloatBytes(const Eigen::VectorXf& values);
absl::StatusOr<Eigen::VectorXf> FloatsFromBytes(const std::string& bytes, Eigen::Index count);

}  // namespace tissueform
