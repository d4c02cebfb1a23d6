// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <string>
#include <string_view>

#include "core/mesh/io/row_counts.h"
#include "core/planning/plan_building/recipe.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/fuzzed_file.h"

namespace tissueform::fuzz {
namespace {

void Require(bool promise) {
  if (!promise) std::abort();
}

void CheckRecipe(const Recipe& recipe) {
  Require(!recipe.segments.empty());
  for (const RecipeSegment& segment : recipe.segments) {
    Require(!segment.name.empty() && segment.pose.scale > 0);
    for (const Plane& plane : segment.planes) Require(plane.normal.allFinite());
  }
  Require(recipe.spacing_mm > 0 && recipe.mesh.edge_mm > 0);
  Require(recipe.poisson_ratio >= 0 && recipe.poisson_ratio < 0.5);
  Require(CheckStiffnessTable(recipe.tissues).ok());
  Require(!RecipeToJson(recipe).empty());
}

}  // namespace

void FuzzRecipe(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const absl::StatusOr<Recipe> recipe = ParseRecipe(text, "fuzzed.json");
  if (recipe.ok()) {
    CheckRecipe(*recipe);
  } else {
    Require(recipe.status().message().find("fuzzed.json") != absl::string_view::npos);
  }
}

void FuzzMeditLines(const uint8_t* data, size_t size) {
  const FuzzedFile file(data, size);
  const absl::Status status = CheckMeditLines(file.path());
  Require(status.ok() || !status.message().empty());
}

}  // namespace tissueform::fuzz
