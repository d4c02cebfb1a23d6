// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/queue/received_rows.h"

namespace tissueform {

// One series with whose it is.
struct WorkListSeries {
  QueuedSeries series = {};
  QueuedStudy study = {};
};

// One export that waits for a person, or is under way.
struct WorkListExport {
  QueuedExport queued = {};
  WorkListSeries of = {};
  std::vector<std::string> pictures = {};  // file names in the export's folder of pictures
};

// What the page shows: names of patients, for those who may see them alone.
struct WorkList {
  std::vector<WorkListExport> exports = {};  // those that are not done first
  std::vector<WorkListSeries> series = {};   // of which a case is made or will be; newest first
  size_t passed_over = 0;                    // others of these studies
};

// As the queue is now. At most kMostWorkListRows of each. Errors: those of the queue.
inline constexpr size_t kMostWorkListRows = 500;
absl::StatusOr<WorkList> ReadWorkList(BridgeQueue* queue);

struct WorkListPageOptions {
  std::string planner_url = {};  // "https://planner.example.org/"; empty: no links
  std::string form_token = {};   // that a form must send back
  std::string notice = {};       // one line over the lists, of what has just happened; may be empty
  bool notice_is_problem = false;
};

// The page as HTML. Everything that comes from images is escaped: nothing in a name is markup.
std::string WorkListPage(const WorkList& list, const WorkListPageOptions& options);

// Its style sheet.
absl::string_view WorkListStyle();

// "&<>\"'" as entities; control characters, and what is no UTF-8, as U+FFFD.
std::string EscapedHtml(absl::string_view text);
// "Planted, Patricia Q" of "Planted^Patricia^Q"; of several groups the first with the others in
// brackets.
std::string ShownName(const std::string& dicom_name);
// "1961-02-03" of "19610203"; anything else stays.
std::string ShownDate(const std::string& dicom_date);

}  // namespace tissueform
