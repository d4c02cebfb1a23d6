// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"
#include "client/pacs_bridge/work/retention_options.h"

namespace tissueform {

// Marks exports as failed that have waited too long for a confirmation, by the wall clock `now_s`,
// and forgets those that ended long ago, with their folders. Returns how many. Errors: those of the
// queue; a folder that cannot be deleted is tried again.
absl::StatusOr<int> DeleteOldExports(BridgeQueue* queue, const RetentionOptions& options,
                                     int64_t now_s);

}  // namespace tissueform
