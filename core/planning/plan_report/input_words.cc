// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/input_words.h"

#include "absl/strings/ascii.h"

namespace tissueform {

InputWords WordsOfSurfaces() {
  return {.of_surfaces = true,
          .a_source = "surfaces",
          .this_source = "these surfaces",
          .the_skin = "the given skin",
          .skin = "given skin",
          .to_skin = "to the given skin",
          .skin_of_source = "given skin"};
}

InputWords WordsOf(const PlanBuild& build) {
  return build.surface_roles.empty() ? InputWords() : WordsOfSurfaces();
}

std::string Capitalized(std::string text) {
  if (!text.empty()) text[0] = absl::ascii_toupper(static_cast<unsigned char>(text[0]));
  return text;
}

}  // namespace tissueform
