// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

inline constexpr size_t kMaxRulesBytes = size_t{1} << 20;

// What is preferred among series that the same rule takes; the first that differs decides.
enum class SeriesPreference { kSoftKernel, kBoneKernel, kThinSlices, kNoContrast, kMoreCoverage };

// Which series is taken, and which recipe makes a plan of it.
struct SeriesRule {
  std::string name = {};
  std::string recipe = {};  // file
  bool draft = false;       // whether a person plans in the browser, beginning with the recipe
  std::string modality = "CT";
  bool axial_only = true;
  int min_slices = 60;
  double max_spacing_mm = 2;
  double max_thickness_mm = 2.5;
  double min_coverage_mm = 100;
  double max_coverage_mm = 600;
  int max_missing = 0;
  bool hounsfield = true;  // whether values must be known as Hounsfield units
  bool derived = false;    // whether reformatted series are taken
  bool contrast = true;    // whether series with contrast medium are taken
  std::vector<std::string> description_has = {};    // one of these words, in any letter case
  std::vector<std::string> description_lacks = {};  // none of these
  std::vector<SeriesPreference> prefer = {
      SeriesPreference::kSoftKernel, SeriesPreference::kThinSlices, SeriesPreference::kNoContrast,
      SeriesPreference::kMoreCoverage};
};

// The text of docs/series-rules.schema.json.
const char* SeriesRulesSchemaText();

// Reads a file of rules (docs/pacs.md), checked against the published schema. A recipe's relative
// path starts at the folder of the file. What a rule does not say is as in SeriesRule.
//
// Errors: those of ReadJsonText, InvalidArgument by JSON pointer.
absl::StatusOr<std::vector<SeriesRule>> ReadSeriesRules(const std::string& path);

// The same for a text; `folder` is where relative recipes start.
absl::StatusOr<std::vector<SeriesRule>> ParseSeriesRules(const std::string& json,
                                                         const std::string& folder);

// Whether their recipes are there and are JSON; what is in them, `plan build` judges.
// Errors: those of ReadJsonText, InvalidArgument with line and column.
absl::Status CheckRecipes(const std::vector<SeriesRule>& rules);

}  // namespace tissueform
