// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mechanics/constraints/head_frame.h"
#include "core/planning/outcome/outcome.h"

namespace tissueform {

// Draws the face before, as the first prediction has it, and as it is, and the distances from it of
// the prediction and of the face before, all on one scale, from the front and from the left; into
// `folder`, which exists. Returns the files' names. Needs an X display (VirtualDisplay).
//
// Errors: those of Figure::WritePng.
absl::StatusOr<std::vector<std::string>> DrawOutcome(const Outcome& outcome, const HeadFrame& frame,
                                                     const std::string& folder);

}  // namespace tissueform
