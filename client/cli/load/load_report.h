// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "nlohmann/json.hpp"

#include "client/cli/load/load_run.h"

namespace tissueform {

// A table of the drags, a line on churn and one on errors.
std::string LoadText(const LoadOptions& options, const LoadResult& result);

// With where it was measured.
nlohmann::ordered_json LoadJson(const LoadOptions& options, const LoadResult& result);

}  // namespace tissueform
