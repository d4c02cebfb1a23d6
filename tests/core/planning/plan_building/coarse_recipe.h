// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/planning/plan_building/recipe.h"

namespace tissueform::testing {

// The whole lower jaw 6 mm forward, with a mesh that is coarse, to be quick.
inline Recipe CoarseRecipe() {
  Recipe recipe;
  recipe.spacing_mm = 2.5;
  recipe.mesh.edge_mm = 6.5;
  recipe.mesh.fine_edge_mm = 5;
  RecipeSegment mandible;
  mandible.name = "mandible";
  mandible.pose.translation_mm.y() = -6;
  recipe.segments = {mandible};
  return recipe;
}

}  // namespace tissueform::testing
