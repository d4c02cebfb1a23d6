// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/constraints/constraint_set.h"

namespace tissueform {

// The lowest vertices of a bar along z fixed, the highest ones the one handle, "end"; for a volume
// mesh and for its boundary surface.
absl::StatusOr<ConstraintSet> ConstrainEnds(const Positions& positions);

}  // namespace tissueform
