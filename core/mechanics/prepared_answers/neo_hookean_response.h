// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <numbers>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/vertex_response.h"

namespace tissueform {

struct NeoHookeanResponseOptions {
  double tolerance_mm = 0.01;  // of the columns: what compression and single precision may put off
  // The prepared range.
  double max_rotation_rad = 30.0 * std::numbers::pi / 180.0;
  double max_estimate_mm = 5.0;  // poses whose estimated error is larger are not covered
  // May be empty. Called with the bytes that the response needs at most, while it is made and
  // later, before any of them is allocated.
  FactorAdmission admission = nullptr;
  PreparationObserver observer = nullptr;  // may be empty; receives the columns
};

// Bytes that a response of so many vertices needs at most, while it is made.
int64_t NeoHookeanResponseBytes(const MeshPreparation& preparation, Eigen::Index num_vertices);

// The neo-Hookean model at `vertices` (any order) as a series in the poses (NeoHookeanSeries): to
// the third order with one handle, to the second with several. No pose with a scale other than 1 is
// covered.
//
// Unlike those of the linear models its error is an ESTIMATE: what the series leaves out is
// measured, when it is made, against converged answers to a few poses (see SeriesErrorMm), such
// that 99 of 100 random poses err less, most of them a quarter to a third. What compression puts
// off is measured too and counted in.
//
// Factorises the elastic system if no model has done so. Holds the columns only, not the
// preparation.
//
// Errors: InvalidArgument (a vertex outside [0, #V), no vertex, an option that is not a positive
// number), those of MeshPreparation::Elastic; what the admission says.
absl::StatusOr<std::unique_ptr<VertexResponse>> CreateNeoHookeanResponse(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const NeoHookeanResponseOptions& options, const Cancellation& cancellation = {});

}  // namespace tissueform
