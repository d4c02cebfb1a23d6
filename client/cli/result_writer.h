// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

#include "core/base/types.h"
#include "core/planning/plan.h"

namespace tissueform {

// Name of the point array that every result holds.
inline constexpr char kDisplacementArray[] = "displacement_mm";

// Writes OUT.vtu: the plan's mesh with its points at `deformed` (#V by 3, LPS), written in the
// plan's own coordinate system; a point array displacement_mm of three doubles; all arrays of the
// plan's mesh, except that an array of that name is replaced.
//
// Errors: FailedPrecondition when `path` is the plan's own mesh; Internal when a position is not
// finite; those of WriteTetMesh.
absl::Status WriteResult(const std::string& path, const Plan& plan, const PlanProblem& problem,
                         const Positions& deformed);

}  // namespace tissueform
