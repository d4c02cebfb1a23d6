// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>

#include "core/ct/voxel_grid.h"

namespace tissueform {

// How much of a part of the bone lies below the grid, in mm, estimated from how its cross-sections
// grow over the border; infinite where they do not. None where the part does not touch the border.
std::optional<double> CutOffBelowMm(const LabelGrid& labels, uint8_t label);

}  // namespace tissueform
