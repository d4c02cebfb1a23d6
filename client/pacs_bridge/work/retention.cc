// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/retention.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "client/pacs_bridge/queue/received_rows.h"
#include "client/pacs_bridge/work/export_retention.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

// What is younger may be on its way into the queue.
constexpr std::chrono::hours kLeastAge{1};

int64_t SecondsOf(fs::file_time_type time) {
  const auto since = std::chrono::file_clock::to_sys(time).time_since_epoch();
  return std::chrono::duration_cast<std::chrono::seconds>(since).count();
}

absl::StatusOr<bool> DeleteImages(BridgeQueue* queue, ReceivedRows* rows,
                                  const QueuedSeries& series) {
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedImage> images, rows->ListImages(series.key));
  std::error_code error;
  bool all_gone = true;
  for (const QueuedImage& image : images) {
    if (image.file.empty()) continue;
    fs::remove(image.file, error);
    all_gone = all_gone && !error;
  }
  fs::remove_all(queue->plan_folder(series.key), error);
  if (!all_gone || error) return false;
  TF_RETURN_IF_ERROR(rows->ForgetFiles(series.key));
  return true;
}

// What came and belongs to no series (of two studies at once, say): nothing else would delete it.
absl::StatusOr<int> DeleteStrangers(BridgeQueue* queue, const std::vector<QueuedSeries>& all,
                                    std::chrono::hours kept, int64_t now_s) {
  ReceivedRows rows(queue);
  std::set<std::string> known;
  for (const QueuedSeries& series : all) {
    TF_ASSIGN_OR_RETURN(const std::vector<QueuedImage> images, rows.ListImages(series.key));
    for (const QueuedImage& image : images) known.insert(image.file);
  }
  int deleted = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator file(queue->received_folder(), error), end;
       !error && file != end; file.increment(error)) {
    std::error_code failed;
    if (known.contains(file->path().string()) || !file->is_regular_file(failed)) continue;
    const int64_t written_s = SecondsOf(file->last_write_time(failed));
    if (failed || !IsOver(written_s, std::max(kept, kLeastAge), now_s)) continue;
    deleted += fs::remove(file->path(), failed) ? 1 : 0;
  }
  return deleted;
}

bool MayBeForgotten(const QueuedSeries& series, std::chrono::hours kept, int64_t now_s) {
  return series.case_name.empty() && !series.has_files && !series.has_header &&
         IsOver(series.done_s, kept, now_s);
}

}  // namespace

absl::StatusOr<int> DeleteOld(BridgeQueue* queue, const RetentionOptions& options, int64_t now_s) {
  ReceivedRows rows(queue);
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> all, rows.List());
  TF_ASSIGN_OR_RETURN(int deleted, DeleteStrangers(queue, all, options.keep_images, now_s));
  TF_ASSIGN_OR_RETURN(const int exports, DeleteOldExports(queue, options, now_s));
  deleted += exports;
  for (QueuedSeries series : all) {
    bool any = false;
    if (series.has_files && IsOver(series.done_s, options.keep_images, now_s)) {
      TF_ASSIGN_OR_RETURN(any, DeleteImages(queue, &rows, series));
      series.has_files = !any;
    }
    if (series.has_header && IsOver(series.done_s, options.keep_headers, now_s)) {
      std::error_code error;
      fs::remove(queue->header_path(series.key), error);
      if (!error) {
        series.has_header = false;
        TF_RETURN_IF_ERROR(rows.Update(series));
        any = true;
      }
    }
    if (MayBeForgotten(series, options.keep_headers, now_s)) {
      TF_RETURN_IF_ERROR(rows.Forget(series.key));
      any = true;
    }
    deleted += any ? 1 : 0;
  }
  return deleted;
}

}  // namespace tissueform
