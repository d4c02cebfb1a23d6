// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/queue/received_rows.h"

namespace tissueform {

// One series with whose it is.
struct ReviewSeries {
  QueuedSeries series = {};
  QueuedStudy study = {};
  std::string draft = {};  // "buildDrafts/{id}" while it waits; else empty
};

// One export that waits for a person, or is under way.
struct ReviewExport {
  QueuedExport queued = {};
  ReviewSeries of = {};
  std::vector<std::string> pictures = {};  // file names in the export's folder of pictures
};

// What the page shows: names of patients, for those who may see them alone.
struct ReviewQueue {
  std::vector<ReviewExport> exports = {};  // those that are not done first
  std::vector<ReviewSeries> series = {};   // of which a case is made or will be; newest first
  size_t passed_over = 0;                  // others of these studies
};

// As the queue is now. At most kMaxReviewRows of each. Errors: those of the queue.
inline constexpr size_t kMaxReviewRows = 500;
absl::StatusOr<ReviewQueue> ReadReviewQueue(BridgeQueue* queue);

}  // namespace tissueform
