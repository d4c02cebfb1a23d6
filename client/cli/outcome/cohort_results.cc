// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/cohort_results.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/csv_table.h"
#include "core/base/json/json_file.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxOutcomeBytes = size_t{16} << 20;

void AddDistances(const CohortCase& row, const CohortGroup& group, const Json& regions,
                  CohortResults* results) {
  for (const Json& region : regions) {
    const Json& found = region.at("predicted_to_real");
    results->distances.push_back({.id = row.id,
                                  .group = group,
                                  .region = region.at("region"),
                                  .compared_share = region.at("compared_share"),
                                  .skin = {.area_cm2 = found.at("area_cm2"),
                                           .mean_mm = found.at("mean_mm"),
                                           .mean_absolute_mm = found.at("mean_absolute_mm"),
                                           .p50_mm = found.at("p50_mm"),
                                           .p90_mm = found.at("p90_mm"),
                                           .p95_mm = found.at("p95_mm"),
                                           .max_mm = found.at("max_mm"),
                                           .share_over_1mm = found.at("share_over_1mm"),
                                           .share_over_2mm = found.at("share_over_2mm")}});
  }
}

void AddLandmarks(const CohortGroup& group, const Json& landmarks, CohortResults* results) {
  if (group.model == "none") return;  // its landmarks do not move
  for (const Json& landmark : landmarks) {
    for (const char* direction : {"forward", "up"}) {
      results->landmarks.push_back(
          {.group = group,
           .landmark = landmark.at("landmark"),
           .direction = direction,
           .predicted_mm = landmark.at(absl::StrCat("predicted_", direction, "_mm")),
           .real_mm = landmark.at(absl::StrCat("real_", direction, "_mm"))});
    }
  }
}

void AddDeviations(const CohortCase& row, const Json& segments, CohortResults* results) {
  for (const Json& segment : segments) {
    if (!segment.contains("deviation")) continue;
    for (const auto& [number, value] : segment.at("deviation").items()) {
      results->deviations.push_back({.operation = row.operation,
                                     .segment = segment.at("segment"),
                                     .number = number,
                                     .value = value});
    }
  }
}

void AddSettings(const CohortCase& row, const Json& by_settings, CohortResults* results) {
  for (const Json& prediction : by_settings) {
    const std::string settings = prediction.at("settings").dump();
    for (const Json& region : prediction.at("regions")) {
      results->settings.push_back({.id = row.id,
                                   .operation = row.operation,
                                   .movement = prediction.at("movement"),
                                   .settings = settings,
                                   .region = region.at("region"),
                                   .mean_absolute_mm = region.at("mean_absolute_mm")});
    }
  }
}

absl::Status AddCase(const CohortCase& row, const Json& outcome, CohortResults* results) {
  try {
    for (const Json& prediction : outcome.at("predictions")) {
      const CohortGroup group = {.operation = row.operation,
                                 .movement = prediction.at("movement"),
                                 .model = prediction.at("model")};
      AddDistances(row, group, prediction.at("regions"), results);
      AddLandmarks(group, prediction.at("landmarks"), results);
    }
    AddDeviations(row, outcome.at("segments"), results);
    AddSettings(row, outcome.at("by_settings"), results);
    return absl::OkStatus();
  } catch (const Json::exception&) {
    return absl::DataLossError(
        absl::StrCat("cases/", row.id,
                     "/outcome.json of the cohort is not as `tissueform outcome` writes it; remove "
                     "its folder and run the cohort again"));
  }
}

}  // namespace

absl::StatusOr<CohortResults> ReadCohortResults(const std::vector<CohortCase>& cases,
                                                const std::vector<CohortRun>& runs,
                                                const std::string& out) {
  CohortResults results;
  for (size_t c = 0; c < cases.size(); ++c) {
    if (!runs[c].refusal.empty()) {
      results.refused.push_back({cases[c].id, cases[c].operation, runs[c].refusal});
      continue;
    }
    TF_ASSIGN_OR_RETURN(
        const std::string text,
        ReadJsonText(CaseFolder(out, cases[c].id) + "/outcome.json", "outcome", kMaxOutcomeBytes));
    TF_RETURN_IF_ERROR(AddCase(cases[c], Json::parse(text, nullptr, false), &results));
    results.compared.push_back(cases[c]);
  }
  return results;
}

absl::Status WriteCohortCsv(const std::string& path, const CohortResults& results) {
  CsvTable table({"case", "operation", "region", "model", "movement", "compared_share", "mean_mm",
                  "mean_absolute_mm", "p50_mm", "p90_mm", "p95_mm", "max_mm", "share_over_1mm",
                  "share_over_2mm"});
  for (const CohortDistance& d : results.distances) {
    table.AddRow({d.id, d.group.operation, d.region, d.group.model, d.group.movement,
                  Cell(d.compared_share), Cell(d.skin.mean_mm), Cell(d.skin.mean_absolute_mm),
                  Cell(d.skin.p50_mm), Cell(d.skin.p90_mm), Cell(d.skin.p95_mm),
                  Cell(d.skin.max_mm), Cell(d.skin.share_over_1mm), Cell(d.skin.share_over_2mm)});
  }
  return table.WriteCsv(path);
}

}  // namespace tissueform
