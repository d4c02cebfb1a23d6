// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "core/planning/plan_building/plan_builder.h"

namespace tissueform {

// How the report names what a plan was built from: a CT, or surfaces alone.
struct InputWords {
  bool of_surfaces = false;
  const char* a_source = "a CT";
  const char* this_source = "this CT";
  const char* the_skin = "the CT's skin";
  const char* skin = "CT skin";
  const char* to_skin = "to the CT's";  // after "Distance of the skin"
  const char* skin_of_source = "skin of the CT";
};

InputWords WordsOfSurfaces();
InputWords WordsOf(const PlanBuild& build);

// With an upper-case letter first.
std::string Capitalized(std::string text);

}  // namespace tissueform
