// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace tissueform {

// Rounds to a whole HU and brings what no CT number is into range: under -1024 becomes -1024
// (scanners fill the corners outside their circle with -2000 and less), over 32767 becomes that.
// The value is finite.
int16_t ToHu(double value);

// InvalidArgument unless the voxels can be the HU of a body in air: there is air (a share of values
// under -500) and matter (over -200). Says so when the values look like HU + 1024 or like an offset
// applied twice, and names the recipe's key "hu_offset". Internal to core/imaging/ct.
absl::Status CheckHu(const std::vector<int16_t>& hu, std::optional<double> hu_offset);

}  // namespace tissueform
