// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "core/planning/plan_building/plan_builder.h"

namespace tissueform {

// What about this CT limits what the plan can predict, a sentence each, for people: a nose that is
// cut off or pressed flat, a chin near the CT's lower border, teeth that touch and were cut apart.
// Nothing is wrong with a plan that has some.
std::vector<std::string> Cautions(const PlanBuild& build);

}  // namespace tissueform
