// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"

#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/ct/ct_volume_reader.h"

namespace tissueform {

// Rounds to a whole number in the range of int16_t. The value is finite.
int16_t ToStored(double value);

// InvalidArgument unless the voxels can be the HU of a body in air: there is air (a share of values
// under -500) and matter (over -200). Says so when the values look like HU + 1024 or like an offset
// applied twice, and names the recipe's key "hu_offset". Internal to core/imaging/ct.
//
// Values under -1024 count as -1024.
absl::Status CheckHu(const std::vector<int16_t>& hu, std::optional<double> hu_offset);

// Decides what the values of a volume are, and marks gray values in it: where `options.values` says
// so, or where it is kAuto, no hu_offset is given, and they can neither be HU nor HU + 1024. HU
// under -1024 become -1024: scanners fill the corners outside their circle with -2000 and less.
// `states_rescale`: the file says how its values become HU; where it does not and they are HU all
// the same, a note says so. Errors: those of CheckHu.
absl::Status SettleValues(const CtReadOptions& options, bool states_rescale, CtVolume* volume);

}  // namespace tissueform
