// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "nlohmann/json.hpp"

#include "client/cli/shared/uncertainty_results.h"

namespace tissueform {

// The band of uncertainty from the material for programs and for people, always with
// kMaterialUncertaintyNotice.

// Places and causes in their order (docs/plan-format.md); lengths in mm.
nlohmann::ordered_json MaterialBandToJson(const MaterialBand& band);

// Of the last place. One line without its end.
std::string MaterialBandText(const MaterialBand& band);

// Of frames, whose vertices are those of the skin. One line without its end.
std::string LargestBandText(double largest_mm);

}  // namespace tissueform
