// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"
#include "client/pacs_bridge/work/retention_options.h"

namespace tissueform {

// Deletes what is older, by the wall clock `now_s`. What is being worked on stays, however old it
// is, and so does what is known of a case: UIDs and whose it is. Returns how many series, exports
// and files of no series had something deleted, or have failed. Errors: those of the queue; a file
// that cannot be deleted is tried again.
absl::StatusOr<int> DeleteOld(BridgeQueue* queue, const RetentionOptions& options, int64_t now_s);

}  // namespace tissueform
