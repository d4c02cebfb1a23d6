// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/deformation/mesh_preparation.h"
#include "core/prepared_answers/vertex_response.h"

namespace tissueform {

struct LinearElasticResponseOptions {
  double tolerance_mm = 0.01;  // of any chosen vertex against the direct solve
  // May be empty. Called with the bytes that the response will hold before any of them is
  // allocated.
  FactorAdmission admission;
  PreparationObserver observer = nullptr;  // may be empty; told of the columns
};

// Bytes of a response of so many vertices; 12 columns a handle.
int64_t LinearElasticResponseBytes(const MeshPreparation& preparation, Eigen::Index num_vertices);

// Linear elasticity at `vertices` (any order), from the columns of ElasticSystem. The model is
// linear in the displacement of a handle, which any pose makes from 12 columns, so there is no
// prepared range and nothing is truncated: the bound is that of single precision, which grows with
// the poses' motion.
//
// Factorises the elastic system if no model has done so. bytes_held() are its own
// columns; it keeps the preparation, which knows the coefficients.
//
// Errors: InvalidArgument (a vertex outside [0, #V), no vertex, a tolerance that is not a positive
// number), those of MeshPreparation::Elastic; what the admission says, before anything is
// allocated.
absl::StatusOr<std::unique_ptr<VertexResponse>> CreateLinearElasticResponse(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const LinearElasticResponseOptions& options, const Cancellation& cancellation = {});

}  // namespace tissueform
