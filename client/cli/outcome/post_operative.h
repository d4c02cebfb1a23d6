// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/planning/outcome/head_registration.h"

namespace tissueform {

struct PostOperativeInput {
  std::string scan;          // a CT as ReadCtVolume takes it, or a surface of the skin
  std::string bone;          // a surface of all bone, with a surface of the skin; or empty
  std::string labels;        // a label map of the CT; or empty
  std::string recipe;        // of whose keys "ct", "metal" and "segmentation" are used; or empty
  std::string axes = "LPS";  // of surfaces: where their axes grow toward
  int threads = 1;
};

// Reads the head after the operation, in LPS of its own scan. Of a CT, head and bone are found as
// `tissueform plan build` finds them; jaws need not be separated.
//
// Errors: those of ReadTriangleMesh, ReadRecipe, ReadCtVolume, SegmentHead and ReadPlanLabels;
// InvalidArgument for axes that are not three letters or that mirror.
absl::StatusOr<PostOperativeHead> ReadPostOperative(const PostOperativeInput& input);

}  // namespace tissueform
