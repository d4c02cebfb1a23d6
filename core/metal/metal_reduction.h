// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>

namespace tissueform {

// Key `metal` of the recipe.
struct MetalOptions {
  bool correct = true;                 // false: metal is neither looked for nor lessened
  std::optional<double> threshold_hu;  // above it a voxel is metal; found from the CT if not given
};

}  // namespace tissueform
