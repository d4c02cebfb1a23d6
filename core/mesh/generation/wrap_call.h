// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/base/process/helper_program.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The program that wraps surfaces with CGAL.
inline constexpr char kWrapProgram[] = "tissueform-wrap";

// CGAL's alpha wrap of a surface's triangles, in the helper program. Any thread may call it.
// Internal to core/mesh/generation.
//
// Errors: those of RunAlphaWrap; ResourceExhausted when a limit stopped it; NotFound when there is
// no such program.
absl::StatusOr<TriangleMesh> CallAlphaWrap(const TriangleMesh& surface, double alpha_mm,
                                           double offset_mm, const IsolationLimits& limits);

using AlphaWrapFunction = absl::StatusOr<TriangleMesh> (*)(const TriangleMesh& surface,
                                                           double alpha_mm, double offset_mm);

// Inside that program: main() returns this.
int RunWrapProgram(AlphaWrapFunction wrap);

}  // namespace tissueform
