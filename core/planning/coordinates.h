// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/planning/plan.h"

namespace tissueform {

// RAS and LPS differ by the signs of x and y: half a turn about z. It is its own inverse and keeps
// handedness, so positions, translations and rotation vectors all change in the same way and tets
// stay positive.

// From `system` to LPS or back.
void SwapToOrFromLps(CoordinateSystem system, Positions* positions);
HandlePose SwapToOrFromLps(CoordinateSystem system, const HandlePose& pose);
SelectBox SwapToOrFromLps(CoordinateSystem system, const SelectBox& box);

}  // namespace tissueform
