// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/series/series_rules.h"

#include <filesystem>
#include <map>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_file.h"
#include "core/base/json/json_schema.h"
#include "core/base/json/json_text.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using RulesJson = nlohmann::json;

const JsonSchema& RulesSchema() {
  static const JsonSchema* const schema = new JsonSchema(SeriesRulesSchemaText());
  return *schema;
}

// What follows reads a text that has passed the schema.

SeriesPreference PreferenceOf(const std::string& name) {
  static const auto* const names = new std::map<std::string, SeriesPreference>{
      {"soft_kernel", SeriesPreference::kSoftKernel},
      {"bone_kernel", SeriesPreference::kBoneKernel},
      {"thin_slices", SeriesPreference::kThinSlices},
      {"no_contrast", SeriesPreference::kNoContrast},
      {"more_coverage", SeriesPreference::kMoreCoverage}};
  return names->at(name);
}

SeriesRule RuleOf(const RulesJson& json, const std::string& folder) {
  SeriesRule rule;
  rule.name = json.value("name", rule.name);
  const std::filesystem::path recipe(json.at("recipe").get<std::string>());
  rule.recipe = (recipe.is_absolute() ? recipe : std::filesystem::path(folder) / recipe).string();
  rule.draft = json.value("draft", rule.draft);
  rule.modality = json.value("modality", rule.modality);
  rule.axial_only = json.value("axial_only", rule.axial_only);
  rule.min_slices = json.value("min_slices", rule.min_slices);
  rule.max_spacing_mm = json.value("max_spacing_mm", rule.max_spacing_mm);
  rule.max_thickness_mm = json.value("max_thickness_mm", rule.max_thickness_mm);
  rule.min_coverage_mm = json.value("min_coverage_mm", rule.min_coverage_mm);
  rule.max_coverage_mm = json.value("max_coverage_mm", rule.max_coverage_mm);
  rule.max_missing = json.value("max_missing", rule.max_missing);
  rule.hounsfield = json.value("hounsfield", rule.hounsfield);
  rule.derived = json.value("derived", rule.derived);
  rule.contrast = json.value("contrast", rule.contrast);
  rule.description_has = json.value("description_has", rule.description_has);
  rule.description_lacks = json.value("description_lacks", rule.description_lacks);
  if (json.contains("prefer")) {
    rule.prefer.clear();
    for (const RulesJson& name : json.at("prefer")) rule.prefer.push_back(PreferenceOf(name));
  }
  return rule;
}

}  // namespace

absl::StatusOr<std::vector<SeriesRule>> ParseSeriesRules(const std::string& json,
                                                         const std::string& folder) {
  TF_ASSIGN_OR_RETURN(const RulesJson document, ParseJsonStrictly(json));
  TF_RETURN_IF_ERROR(RulesSchema().Check(document));
  std::vector<SeriesRule> rules;
  for (const RulesJson& rule : document.at("rules")) rules.push_back(RuleOf(rule, folder));
  return rules;
}

absl::Status CheckRecipes(const std::vector<SeriesRule>& rules) {
  for (const SeriesRule& rule : rules) {
    TF_ASSIGN_OR_RETURN(const std::string text,
                        ReadJsonText(rule.recipe, "recipe", kMaxRulesBytes));
    if (const absl::Status read = ParseJsonStrictly(text).status(); !read.ok()) {
      return {read.code(), absl::StrCat("recipe ", rule.recipe, ": ", read.message())};
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<SeriesRule>> ReadSeriesRules(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const std::string text, ReadJsonText(path, "series rules", kMaxRulesBytes));
  return ParseSeriesRules(text, std::filesystem::path(path).parent_path().string());
}

}  // namespace tissueform
