// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "core/imaging/anatomy/landmarks.h"

namespace tissueform {

// The landmarks of bone and teeth, and the planes. `metal` is a mask on the grid of the parts, or
// has no voxels. Internal to core/imaging/anatomy.
absl::Status FindJawLandmarks(const LabelGrid& parts, const LabelGrid& metal, Landmarks* landmarks);

}  // namespace tissueform
