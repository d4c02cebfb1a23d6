// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"

#include "core/mesh/generation/tetgen_call.h"

namespace tissueform {

// TetGen with the surface, `holes_mm` instead of those of the options, and the switches that the
// options stand for. It may crash, throw, loop or print: call it in a helper program only. Internal
// to core/mesh/generation.
//
// Errors: InvalidArgument, ResourceExhausted.
absl::StatusOr<RawTets> RunTetgen(const TriangleMesh& surface,
                                  const std::vector<Eigen::Vector3d>& holes_mm,
                                  const TetrahedralizationOptions& options);

}  // namespace tissueform
