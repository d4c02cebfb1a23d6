// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/export_retention.h"

#include <chrono>
#include <filesystem>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"

#include "client/pacs_bridge/queue/export_rows.h"
#include "core/base/status_macros.h"

namespace tissueform {

absl::StatusOr<int> DeleteOldExports(BridgeQueue* queue, const RetentionOptions& options,
                                     int64_t now_s) {
  ExportRows rows(queue);
  const auto days = std::chrono::duration_cast<std::chrono::hours>(options.keep_asked).count() / 24;
  TF_ASSIGN_OR_RETURN(int changed,
                      rows.FailAsked(now_s - std::chrono::seconds(options.keep_asked).count(),
                                     absl::StrCat("the patient was not confirmed for ", days,
                                                  " days; request it again in the planner")));
  TF_ASSIGN_OR_RETURN(const std::vector<QueuedExport> all, rows.List());
  for (const QueuedExport& queued : all) {
    if (!IsOver(queued.done_s, options.keep_exports, now_s)) continue;
    std::error_code error;
    std::filesystem::remove_all(queue->object_folder(queued.key), error);
    if (error) continue;
    TF_RETURN_IF_ERROR(rows.Remove(queued.name));
    ++changed;
  }
  return changed;
}

}  // namespace tissueform
