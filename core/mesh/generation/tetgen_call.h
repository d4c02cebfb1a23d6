// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mesh/generation/tetrahedralization.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// What TetGen makes, before anything of it is checked.
struct RawTets {
  Positions positions;
  TetIndices tets;
  Eigen::VectorXd attributes;  // #T, or none where there are no regions
};

// The program that fills surfaces with TetGen.
inline constexpr char kTetgenProgram[] = "tissueform-tetrahedralize";

// TetGen in the helper program, with `holes_mm` instead of those of the options, within the limits
// of the options. Any thread may call it. Internal to core/mesh/generation.
//
// Errors: those of RunTetgen; InvalidArgument when TetGen crashed; ResourceExhausted when a limit
// stopped it; NotFound when there is no such program.
absl::StatusOr<RawTets> CallTetgen(const TriangleMesh& surface,
                                   const std::vector<Eigen::Vector3d>& holes_mm,
                                   const TetrahedralizationOptions& options);

// Inside that program: main() returns this. Answers with what RunTetgen (tetgen_adaptor.h) makes of
// the request.
int RunTetgenProgram(absl::StatusOr<RawTets> (*run)(const TriangleMesh& surface,
                                                    const std::vector<Eigen::Vector3d>& holes_mm,
                                                    const TetrahedralizationOptions& options));

}  // namespace tissueform
