// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"

namespace tissueform {

// How long what shows a patient stays in the bridge's folder.
struct RetentionOptions {
  // Received images and the plan that was built of them, after the series is done: published,
  // passed over, failed, stopped midway, or complete where nothing is chosen. Files that belong to
  // no series, after they came.
  std::chrono::hours keep_images{24 * 7};
  // The header without pixels that stands for the PACS where that cannot be asked for one; and what
  // is known of a series of which no case was made, and of its patient.
  std::chrono::hours keep_headers{24 * 90};
  // An export that nobody confirms, with the pictures of it; then it has failed.
  std::chrono::hours keep_asked{24 * 14};
  // What is known of an export, after the server was told how it has ended.
  std::chrono::hours keep_exports{24 * 30};
};

// Deletes what is older, by the wall clock `now_s`. What is being worked on stays, however old it
// is, and so does what is known of a case: UIDs and whose it is. Returns how many series, exports
// and files of no series had something deleted, or have failed. Errors: those of the queue; a file
// that cannot be deleted is tried again.
absl::StatusOr<int> DeleteOld(BridgeQueue* queue, const RetentionOptions& options, int64_t now_s);

}  // namespace tissueform
