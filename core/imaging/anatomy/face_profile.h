// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "core/imaging/anatomy/landmarks.h"

namespace tissueform {

// The landmarks of the skin, from those of the bone. Internal to core/imaging/anatomy.
absl::Status FindSkinLandmarks(const HeadSegmentation& head, Landmarks* landmarks);

}  // namespace tissueform
