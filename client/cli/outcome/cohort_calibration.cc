// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "client/cli/outcome/cohort_tables.h"
#include "client/cli/outcome/outcome_json.h"
#include "core/planning/outcome/cohort_statistics.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

// What decides which setting is best: all regions together. Settings are of the whole model, and so
// is their choice.
constexpr char kDeciding[] = "face";

// The errors of one operation and movement.
struct ErrorTable {
  std::vector<std::string> cases;
  std::vector<std::string> settings;               // the plan's own first
  std::map<std::string, Eigen::MatrixXd> regions;  // #cases by #settings, mm; NaN: not compared
};

// The number of names where it is not among them.
Eigen::Index PlaceOf(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) - names.begin();
}

// Settings of all cases, in the first case's order.
std::vector<std::string> CommonSettings(
    const std::map<std::string, std::vector<std::string>>& of_case) {
  std::vector<std::string> common = of_case.begin()->second;
  for (const auto& entry : of_case) {
    const std::vector<std::string>& settings = entry.second;
    std::erase_if(common, [&settings](const std::string& candidate) {
      return std::ranges::find(settings, candidate) == settings.end();
    });
  }
  return common;
}

ErrorTable TableOf(const std::vector<CohortSetting>& rows) {
  std::map<std::string, std::vector<std::string>> of_case;
  for (const CohortSetting& row : rows) {
    if (row.region == kDeciding) of_case[row.id].push_back(row.settings);
  }
  ErrorTable table;
  if (of_case.empty()) return table;
  for (const auto& [id, settings] : of_case) table.cases.push_back(id);
  table.settings = CommonSettings(of_case);
  const auto num_cases = static_cast<Eigen::Index>(table.cases.size());
  const auto num_settings = static_cast<Eigen::Index>(table.settings.size());
  for (const CohortSetting& row : rows) {
    const Eigen::Index setting = PlaceOf(table.settings, row.settings);
    const Eigen::Index patient = PlaceOf(table.cases, row.id);
    if (setting == num_settings || patient == num_cases) continue;
    auto& errors = table.regions[row.region];
    if (errors.size() == 0) errors.setConstant(num_cases, num_settings, NAN);
    errors(patient, setting) = row.mean_absolute_mm;
  }
  return table;
}

// Of the patients that have the region: with the plan's settings, with those chosen by the others.
Json RegionJson(const std::string& region, const Eigen::MatrixXd& errors,
                const std::vector<Eigen::Index>& chosen) {
  std::vector<double> before;
  std::vector<double> after;
  std::vector<double> differences;
  for (Eigen::Index patient = 0; patient < errors.rows(); ++patient) {
    const double with_chosen = errors(patient, chosen[static_cast<size_t>(patient)]);
    if (std::isnan(with_chosen) || std::isnan(errors(patient, 0))) continue;
    before.push_back(errors(patient, 0));
    after.push_back(with_chosen);
    differences.push_back(Rounded(with_chosen - errors(patient, 0)));
  }
  if (before.empty()) return nullptr;
  Json json = {{"region", region},
               {"plan_mean_mm", Rounded(SummarizeCohort(before).mean_mm)},
               {"calibrated_mean_mm", Rounded(SummarizeCohort(after).mean_mm)}};
  json.update(PairJson(differences));
  return json;
}

// How many patients got each setting, the most frequent first.
Json ChosenJson(const ErrorTable& table, const std::vector<Eigen::Index>& chosen) {
  std::map<Eigen::Index, int> counts;
  for (const Eigen::Index setting : chosen) ++counts[setting];
  std::vector<std::pair<Eigen::Index, int>> rows(counts.begin(), counts.end());
  std::ranges::stable_sort(rows, std::greater<>(), [](const auto& row) { return row.second; });
  Json list = Json::array();
  for (const auto& [setting, count] : rows) {
    list.push_back({{"settings", Json::parse(table.settings[static_cast<size_t>(setting)])},
                    {"cases", count}});
  }
  return list;
}

Json CalibratedJson(const ErrorTable& table) {
  const Eigen::MatrixXd& deciding = table.regions.at(kDeciding);
  const std::vector<Eigen::Index> chosen = BestSettingsOfOthers(deciding);
  const auto next = static_cast<size_t>(BestSetting(deciding));
  Json regions = Json::array();
  for (const auto& [region, errors] : table.regions) {
    if (Json row = RegionJson(region, errors, chosen); !row.is_null()) regions.push_back(row);
  }
  return {{"cases", table.cases.size()},
          {"settings_tried", table.settings.size()},
          {"chosen", ChosenJson(table, chosen)},
          {"next_patient", Json::parse(table.settings[next])},
          {"regions", regions}};
}

}  // namespace

Json CalibrationJson(const CohortResults& results) {
  Json list = Json::array();
  for (const std::string& operation : OperationsOf(results)) {
    for (const char* movement : {"real", "planned"}) {
      std::vector<CohortSetting> rows;
      for (const CohortSetting& row : results.settings) {
        if (IsOf(row.operation, operation) && row.movement == movement) rows.push_back(row);
      }
      const ErrorTable table = TableOf(rows);
      if (table.cases.size() < kLeastCalibrated) continue;
      Json json = {{"operation", operation}, {"movement", movement}};
      json.update(CalibratedJson(table));
      list.push_back(json);
    }
  }
  return list;
}

}  // namespace tissueform
