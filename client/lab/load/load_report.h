// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "nlohmann/json.hpp"

#include "client/lab/load/load_run.h"

namespace tissueform {

// "p50 / p90 / p99 / largest" with so many digits, or a dash.
std::string PercentilesText(const std::vector<double>& values, int digits);
// The same with their count, or null.
nlohmann::ordered_json PercentilesJson(const std::vector<double>& values);
// How many there are, and the first ones' reasons and messages, a line each.
std::string ErrorsText(const std::vector<absl::Status>& errors);

// A table of the drags, a line on churn and one on errors.
std::string LoadText(const LoadOptions& options, const LoadResult& result);

// With where it was measured.
nlohmann::ordered_json LoadJson(const LoadOptions& options, const LoadResult& result);

}  // namespace tissueform
