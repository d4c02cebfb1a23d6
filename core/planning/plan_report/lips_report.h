// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/imaging/anatomy/lip_contact.h"
#include "core/planning/plan_report/input_words.h"

namespace tissueform {

// The key "lips" of report.json (docs/recipe-format.md).
// `parted`: whether the model parts them.
nlohmann::ordered_json LipsJson(const LipContact& contact, bool parted);

// Where unparted lips are one piece of tissue, and how large it is; nothing where they are parted
// on all but 5 mm.
std::vector<std::string> LipsCautions(const LipContact& contact, const InputWords& words = {});

}  // namespace tissueform
