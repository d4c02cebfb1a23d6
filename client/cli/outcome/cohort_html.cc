// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

#include "client/cli/outcome/cohort_plots.h"
#include "client/cli/outcome/cohort_results.h"
#include "core/planning/plan_report/html_text.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

std::string Words(const Json& name) {
  return absl::StrReplaceAll(name.get<std::string>(), {{"_", " "}});
}

std::string ModelName(const std::string& model) {
  return model == "none" ? "no prediction" : absl::StrReplaceAll(model, {{"_", " "}});
}

std::string Percent(const Json& share) {
  return absl::StrFormat("%.0f %%", 100 * share.get<double>());
}

std::string Fixed(const Json& value) {
  if (value.is_null()) return "";
  return absl::StrFormat("%.2f", std::round(100 * value.get<double>()) / 100 + 0.0);  // no "-0.00"
}

Json DistanceRow(const Json& row) {
  const std::string interval =
      row["mean_low_mm"].is_null()
          ? ""
          : absl::StrCat(Fixed(row["mean_low_mm"]), " to ", Fixed(row["mean_high_mm"]));
  return {{"region", Words(row["region"])},
          {"model", ModelName(row["model"])},
          {"n", row["n"]},
          {"mean ± SD_mm", absl::StrCat(Fixed(row["mean_mm"]), " ± ", Fixed(row["sd_mm"]))},
          {"95 % interval of the mean_mm", interval},
          {"median_mm", Fixed(row["median_mm"])},
          {"p90_mm", Fixed(row["p90_mm"])},
          {"patients within 1 mm", Percent(row["within_1mm"])},
          {"patients within 2 mm", Percent(row["within_2mm"])},
          {"area within 1 mm", Percent(row["area_within_1mm"])},
          {"area within 2 mm", Percent(row["area_within_2mm"])},
          {"signed mean_mm", Fixed(row["bias_mm"])}};
}

std::string PText(double p) { return p < 0.0001 ? "< 0.0001" : absl::StrFormat("%.4f", p); }

Json PairRow(const Json& row) {
  return {{"region", Words(row["region"])},
          {"model", ModelName(row["model"])},
          {"against", ModelName(row["other"])},
          {"n", row["n"]},
          {"mean difference_mm", Fixed(row["mean_difference_mm"])},
          {"median difference_mm", Fixed(row["median_difference_mm"])},
          {"p", PText(row["p"])},
          {"computed", row["exact"].get<bool>() ? "exact" : "normal approximation"}};
}

// The rows of one operation and movement.
std::string TableOf(const Json& list, const std::string& operation, const std::string& movement,
                    Json (*to_row)(const Json&)) {
  Json rows = Json::array();
  for (const Json& row : list) {
    const bool is_of = row["operation"] == operation && row["movement"] == movement;
    if (is_of) rows.push_back(to_row(row));
  }
  return rows.empty() ? "<p>No case.</p>\n" : JsonColumns(rows);
}

std::vector<std::string> OperationsIn(const Json& list) {
  std::vector<std::string> names;
  for (const Json& row : list) {
    const std::string name = row["operation"];
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
  return names;
}

std::string MovementText(const std::string& movement) {
  return movement == "real" ? "predicted from the real movement (the model's error)"
                            : "predicted from the plan (the model's and the surgeon's error)";
}

// All operations open, each by itself folded.
std::string DistanceSections(const Json& json) {
  std::string html;
  for (const std::string& operation : OperationsIn(json["distances"])) {
    for (const char* movement : {"real", "planned"}) {
      const std::string title =
          absl::StrCat("Mean absolute distance, ", operation, ", ", MovementText(movement));
      const std::string table = TableOf(json["distances"], operation, movement, DistanceRow);
      html += html.empty() ? HtmlSection(title, table) : HtmlFolded(title, table);
    }
  }
  return html;
}

std::string PairSections(const Json& json) {
  std::string html;
  for (const std::string& operation : OperationsIn(json["paired_tests"])) {
    for (const char* movement : {"real", "planned"}) {
      html += HtmlFolded(
          absl::StrCat("Paired tests between models, ", operation, ", ", MovementText(movement)),
          absl::StrCat("<p>Wilcoxon's signed rank test, two-sided, of the mean absolute distances "
                       "of the same patients. n: pairs that differ. A negative difference: the "
                       "first model is nearer. The p values are not corrected for their "
                       "number.</p>\n",
                       TableOf(json["paired_tests"], operation, movement, PairRow)));
    }
  }
  return html;
}

std::string SettingsText(const Json& settings) {
  const std::string vestibule =
      settings["vestibule_mm"].is_null()
          ? "vestibule as planned"
          : absl::StrFormat("vestibule %.0f mm", settings["vestibule_mm"].get<double>());
  return absl::StrFormat("stiffness contrast %.1f, %s, seal %s",
                         settings["stiffness_contrast"].get<double>(), vestibule,
                         settings["seal"].get<bool>() ? "on" : "off");
}

std::string CalibrationTables(const Json& calibration) {
  Json regions = Json::array();
  for (const Json& row : calibration["regions"]) {
    regions.push_back({{"region", Words(row["region"])},
                       {"patients", row["pairs"]},
                       {"plan's settings_mm", Fixed(row["plan_mean_mm"])},
                       {"calibrated_mm", Fixed(row["calibrated_mean_mm"])},
                       {"mean difference_mm", Fixed(row["mean_difference_mm"])},
                       {"p", PText(row["p"])}});
  }
  Json chosen = Json::array();
  for (const Json& row : calibration["chosen"]) {
    chosen.push_back({{"settings", SettingsText(row["settings"])}, {"patients", row["cases"]}});
  }
  return absl::StrCat("<p>For each patient linear_elastic gets the settings, of ",
                      calibration["settings_tried"].get<int>(),
                      ", that were best for all other patients (leave-one-out): no patient's error "
                      "is fitted and reported at once. A negative difference: calibration is "
                      "nearer. Best of all patients, for the next one: ",
                      SettingsText(calibration["next_patient"]), ".</p>\n", JsonColumns(regions),
                      JsonColumns(chosen));
}

std::string CalibrationSections(const Json& json) {
  std::string html;
  for (const Json& calibration : json["calibration"]) {
    html += HtmlFolded(absl::StrCat("Calibration, ", calibration["operation"].get<std::string>(),
                                    ", ", MovementText(calibration["movement"])),
                       CalibrationTables(calibration));
  }
  return html;
}

std::string CumulativePlots(const CohortResults& results) {
  std::vector<std::pair<std::string, std::vector<NamedValues>>> regions;
  for (const CohortDistance& distance : results.distances) {
    if (distance.group.movement == "planned") continue;
    auto region =
        std::ranges::find(regions, distance.region, &decltype(regions)::value_type::first);
    if (region == regions.end()) region = regions.insert(regions.end(), {distance.region, {}});
    const std::string name = ModelName(distance.group.model);
    auto curve = std::ranges::find(region->second, name, &NamedValues::name);
    if (curve == region->second.end()) {
      curve = region->second.insert(region->second.end(), {name, {}});
    }
    curve->values.push_back(distance.skin.mean_absolute_mm);
  }
  std::string html;
  for (const auto& [region, curves] : regions) {
    html += CumulativePlot(absl::StrReplaceAll(region, {{"_", " "}}), curves);
  }
  return html;
}

std::string PlotsOfModel(const CohortResults& results, const std::string& model) {
  std::vector<std::pair<std::string, std::vector<MeasuredPair>>> groups;
  for (const CohortLandmark& row : results.landmarks) {
    if (row.group.movement != "real" || row.group.model != model) continue;
    const std::string title =
        absl::StrCat(absl::StrReplaceAll(row.landmark, {{"_", " "}}), ", ", row.direction);
    auto group = std::ranges::find(groups, title, &decltype(groups)::value_type::first);
    if (group == groups.end()) group = groups.insert(groups.end(), {title, {}});
    group->second.push_back({row.predicted_mm, row.real_mm});
  }
  std::string html;
  for (const auto& [title, pairs] : groups) {
    if (pairs.size() < 2) continue;
    std::vector<double> differences;
    differences.reserve(pairs.size());
    for (const MeasuredPair& pair : pairs) differences.push_back(pair.predicted - pair.real);
    html += AgreementPlot(title, pairs, AgreementOf(differences));
  }
  return html;
}

std::string AgreementTable(const Json& landmarks, const std::string& model) {
  Json rows = Json::array();
  for (const Json& row : landmarks) {
    if (row["model"] != model || row["movement"] != "real" || !row.contains("bias_mm")) continue;
    rows.push_back({{"operation", row["operation"]},
                    {"landmark", Words(row["landmark"])},
                    {"direction", row["direction"]},
                    {"n", row["n"]},
                    {"bias_mm", Fixed(row["bias_mm"])},
                    {"SD_mm", Fixed(row["sd_mm"])},
                    {"limits of agreement_mm",
                     absl::StrCat(Fixed(row["low_mm"]), " to ", Fixed(row["high_mm"]))}});
  }
  return rows.empty() ? "" : JsonColumns(rows);
}

std::string AgreementSections(const CohortResults& results, const Json& json) {
  std::vector<std::string> models;
  for (const CohortLandmark& row : results.landmarks) {
    if (std::ranges::find(models, row.group.model) == models.end()) {
      models.push_back(row.group.model);
    }
  }
  std::string html;
  for (const std::string& model : models) {
    const std::string table = AgreementTable(json["landmarks"], model);
    if (table.empty()) continue;
    html += HtmlFolded(
        absl::StrCat("Movement of landmarks, predicted against real (Bland-Altman): ",
                     ModelName(model)),
        absl::StrCat("<p>From the real movement of the bone. Bias: predicted minus real. Dashed: "
                     "limits of agreement, bias ± 1.96 SD.</p>\n",
                     PlotsOfModel(results, model), table));
  }
  return html;
}

std::string CaseList(const CohortResults& results) {
  std::string rows = "<table>\n<tr><th>case</th><th>operation</th><th>report</th></tr>\n";
  for (const CohortCase& row : results.compared) {
    absl::StrAppend(&rows, "<tr><td>", EscapeHtml(row.id), "</td><td>", EscapeHtml(row.operation),
                    "</td><td><a href=\"cases/", EscapeHtml(row.id),
                    "/outcome.html\">open</a></td></tr>\n");
  }
  return absl::StrCat(rows, "</table>\n");
}

}  // namespace

std::string CohortHtml(const CohortResults& results, const Json& json) {
  std::string html = absl::StrCat(
      "<h1>Predictions and operated faces of a cohort</h1>\n<p class=\"lead\">Research use. ",
      results.compared.size(), " of ", results.compared.size() + results.refused.size(),
      " patients compared. One number a patient: the mean absolute distance from the predicted "
      "skin to the operated one.</p>\n");
  if (!json["failed"].empty()) html += HtmlSection("Not compared", JsonColumns(json["failed"]));
  if (results.compared.empty()) return HtmlPage("Cohort", html);
  absl::StrAppend(
      &html, DistanceSections(json),
      HtmlSection("Cumulative errors",
                  absl::StrCat("<p>Share of patients whose mean absolute distance is at most x; "
                               "predicted from the real movement.</p>\n",
                               CumulativePlots(results))),
      PairSections(json), CalibrationSections(json), AgreementSections(results, json));
  if (!json["segment_deviations"].empty()) {
    html += HtmlFolded("Deviations of the segments from the plan (mm, degrees)",
                       JsonColumns(json["segment_deviations"]));
  }
  return HtmlPage("Cohort", absl::StrCat(html, HtmlFolded("Cases", CaseList(results))));
}

}  // namespace tissueform
