// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/status_text.h"

#include <map>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"

#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/queue/received_rows.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

struct Everything {
  std::vector<QueuedSeries> series = {};
  std::vector<QueuedExport> exports = {};
};

absl::StatusOr<Everything> ReadEverything(BridgeQueue* queue) {
  Everything all;
  TF_ASSIGN_OR_RETURN(all.series, ReceivedRows(queue).List());
  TF_ASSIGN_OR_RETURN(all.exports, ExportRows(queue).List());
  return all;
}

const std::string& WhyOf(const QueuedSeries& series) {
  return series.last_error.empty() ? series.reason : series.last_error;
}

const std::string& WhyOf(const QueuedExport& queued) {
  return queued.last_error.empty() ? queued.note : queued.last_error;
}

}  // namespace

absl::StatusOr<std::string> StatusTable(BridgeQueue* queue) {
  TF_ASSIGN_OR_RETURN(const Everything all, ReadEverything(queue));
  std::string text = absl::StrFormat("%-32s %-4s %6s %-11s %3s  %s\n", "SERIES", "MOD", "IMAGES",
                                     "STATE", "TRY", "WHY");
  for (const QueuedSeries& series : all.series) {
    absl::StrAppendFormat(&text, "%-32s %-4s %6d %-11s %3d  %s\n", series.key,
                          series.modality.substr(0, 4), series.images,
                          SeriesStateName(series.state), series.attempts, WhyOf(series));
  }
  absl::StrAppendFormat(&text, "\n%-44s %-11s %3s  %s\n", "EXPORT", "STATE", "TRY", "WHY");
  for (const QueuedExport& queued : all.exports) {
    absl::StrAppendFormat(&text, "%-44s %-11s %3d  %s\n", queued.name,
                          BridgeExportStateName(queued.state), queued.attempts, WhyOf(queued));
  }
  return text;
}

absl::StatusOr<std::string> StatusJson(BridgeQueue* queue) {
  TF_ASSIGN_OR_RETURN(const Everything all, ReadEverything(queue));
  nlohmann::ordered_json json = {{"series", nlohmann::ordered_json::array()},
                                 {"exports", nlohmann::ordered_json::array()}};
  for (const QueuedSeries& series : all.series) {
    json["series"].push_back({{"key", series.key},
                              {"state", SeriesStateName(series.state)},
                              {"images", series.images},
                              {"reason", series.reason},
                              {"case", series.case_name},
                              {"attempts", series.attempts},
                              {"last_error", series.last_error},
                              {"has_files", series.has_files}});
  }
  for (const QueuedExport& queued : all.exports) {
    json["exports"].push_back({{"name", queued.name},
                               {"state", BridgeExportStateName(queued.state)},
                               {"prediction", queued.prediction},
                               {"case", queued.case_name},
                               {"note", queued.note},
                               {"attempts", queued.attempts},
                               {"last_error", queued.last_error}});
  }
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

absl::StatusOr<std::string> SeriesTable(BridgeQueue* queue, SeriesIntake* intake) {
  ReceivedRows rows(queue);
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> all, rows.List());
  std::map<std::string, std::vector<QueuedSeries>> studies;
  for (const QueuedSeries& series : all) studies[series.study_uid].push_back(series);
  std::string text;
  for (const auto& [uid, of_study] : studies) {
    TF_ASSIGN_OR_RETURN(const QueuedStudy study, rows.GetStudy(uid));
    absl::StrAppend(&text, "study of ", study.date.empty() ? "unknown date" : study.date, " (", uid,
                    ")\n");
    for (const QueuedSeries& series : of_study) {
      const absl::StatusOr<SeriesFacts> facts = intake->FactsOf(series);
      absl::StrAppend(&text, "  ", series.key, "  ", SeriesStateName(series.state), "\n      ",
                      series.modality.substr(0, 16), ", ",
                      facts.ok() ? DescribeFacts(*facts) : std::string(facts.status().message()),
                      "\n");
      if (!WhyOf(series).empty()) absl::StrAppend(&text, "      ", WhyOf(series), "\n");
    }
  }
  return text.empty() ? "nothing received yet\n" : text;
}

}  // namespace tissueform
