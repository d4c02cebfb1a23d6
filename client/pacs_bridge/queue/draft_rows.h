// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"

namespace tissueform {

// A draft on the server, and the series that it is of.
struct QueuedDraft {
  std::string name = {};    // "buildDrafts/{id}"
  std::string series = {};  // key
  int64_t images = 0;       // of the series when it was sent
};

// The drafts that were sent, until the server no longer reports them. Its queue must outlive it.
// Thread-safe.
class DraftRows {
 public:
  explicit DraftRows(BridgeQueue* queue) : queue_(queue) {}

  absl::Status Add(const QueuedDraft& draft);
  // In the order in which they were sent.
  absl::StatusOr<std::vector<QueuedDraft>> List();
  absl::Status Remove(const std::string& name);
  // A case that was built of the draft is one of its series.
  absl::Status AddCase(const QueuedDraft& draft, const std::string& case_name);

 private:
  BridgeQueue* const queue_;
};

}  // namespace tissueform
