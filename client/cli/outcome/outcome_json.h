// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "nlohmann/json.hpp"

#include "core/mechanics/constraints/head_frame.h"
#include "core/planning/outcome/outcome.h"

namespace tissueform {

// What outcome.json holds (docs/outcome.md): names no patient, file or folder.
nlohmann::ordered_json OutcomeJson(const Outcome& outcome, const HeadFrame& frame);

// The page of the same, with pictures by their names in "pictures".
std::string OutcomeHtml(const nlohmann::ordered_json& outcome,
                        const std::vector<std::string>& pictures);

// To thousandths, as these files have numbers: what is beyond is noise, and files stay readable.
double Rounded(double value);

}  // namespace tissueform
