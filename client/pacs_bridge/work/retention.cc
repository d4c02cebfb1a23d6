// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/retention.h"

#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "client/pacs_bridge/queue/received_rows.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

bool IsOver(int64_t since_s, std::chrono::hours kept, int64_t now_s) {
  return since_s > 0 && now_s - since_s > std::chrono::seconds(kept).count();
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

}  // namespace

absl::StatusOr<int> DeleteOld(BridgeQueue* queue, const RetentionOptions& options, int64_t now_s) {
  ReceivedRows rows(queue);
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedSeries> all, rows.List());
  int deleted = 0;
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
    deleted += any ? 1 : 0;
  }
  return deleted;
}

}  // namespace tissueform
