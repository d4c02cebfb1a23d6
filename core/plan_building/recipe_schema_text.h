// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// The text of docs/recipe.schema.json.
const char* RecipeSchemaText();

}  // namespace tissueform
