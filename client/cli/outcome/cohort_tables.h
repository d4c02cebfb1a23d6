// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "client/cli/outcome/cohort_results.h"

namespace tissueform {

// What the tables of cohort.json have in common.

// All together first, then each operation; only together where there is one.
std::vector<std::string> OperationsOf(const CohortResults& results);

// Whether a case with this operation belongs to a group of OperationsOf.
bool IsOf(const std::string& operation, const std::string& group);

// Wilcoxon's signed rank test of paired differences in mm, and their mean and median.
nlohmann::ordered_json PairJson(const std::vector<double>& differences);

// The leave-one-out calibration of each operation and movement with at least kLeastCalibrated
// cases; only settings that every case was predicted with. Empty without --calibrate.
nlohmann::ordered_json CalibrationJson(const CohortResults& results);

inline constexpr size_t kLeastCalibrated = 3;

// What surgery and the model err by in this cohort, for --deviations of `tissueform deform`
// (docs/deviations.schema.json): of all operations together, and of each with at least
// kLeastForDeviations figures. Empty where the whole cohort has fewer of the model.
nlohmann::ordered_json DeviationFileJson(const CohortResults& results, const std::string& model);

inline constexpr size_t kLeastForDeviations = 5;

}  // namespace tissueform
