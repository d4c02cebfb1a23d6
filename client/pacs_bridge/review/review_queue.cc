// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/review/review_queue.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <system_error>

#include "client/pacs_bridge/queue/draft_rows.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

std::vector<std::string> PicturesIn(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator file(folder, error), end; !error && file != end;
       file.increment(error)) {
    if (file->path().extension() == ".png") names.push_back(file->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

absl::StatusOr<ReviewQueue> ReadReviewQueue(BridgeQueue* queue) {
  ReceivedRows received(queue);
  ExportRows exports(queue);
  ReviewQueue list;
  TF_ASSIGN_OR_RETURN(std::vector<QueuedSeries> all, received.List());
  std::reverse(all.begin(), all.end());
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedDraft> drafts, DraftRows(queue).List());
  std::map<std::string, std::string> draft_of;
  for (const QueuedDraft& draft : drafts) draft_of[draft.series] = draft.name;
  for (const QueuedSeries& series : all) {
    if (series.state == SeriesState::kPassedOver) {
      ++list.passed_over;
      continue;
    }
    TF_ASSIGN_OR_RETURN(const QueuedStudy study, received.GetStudy(series.study_uid));
    const bool waits = series.state == SeriesState::kDraft;
    if (list.series.size() < kMaxReviewRows) {
      list.series.push_back({series, study, waits ? draft_of[series.key] : ""});
    }
  }
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedExport> asked, exports.List());
  for (const QueuedExport& queued : asked) {
    if (queued.state == BridgeExportState::kReported || list.exports.size() >= kMaxReviewRows) {
      continue;
    }
    // Also of an earlier case of its series.
    const absl::StatusOr<QueuedSeries> of = received.GetByCase(queued.case_name);
    if (!of.ok()) continue;
    TF_ASSIGN_OR_RETURN(const QueuedStudy study, received.GetStudy(of->study_uid));
    list.exports.push_back(
        {queued, {*of, study}, PicturesIn(queue->object_folder(queued.key) + "/pictures")});
  }
  std::stable_sort(
      list.exports.begin(), list.exports.end(),
      [](const ReviewExport& a, const ReviewExport& b) { return a.queued.state < b.queued.state; });
  return list;
}

}  // namespace tissueform
