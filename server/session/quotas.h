// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// What one principal may take of the server; not applied without logins, since then all callers are
// one. What is over a quota is refused with ResourceExhausted, QUOTA_EXCEEDED and the time
// after which it is worth trying again. A drag's surplus poses are not calls: they are coalesced.
struct Quotas {
  int calls_per_second = 200;  // on average; twice as many at once
  int waiting_calls = 64;      // that are answered or wait for it, streams apart
  int streams = 16;            // drags and watches
  int sessions = 500;          // kept, in memory or not
  int64_t memory_bytes = 0;    // of sessions and what they need; 0: half of the memory budget
  int64_t disk_bytes = int64_t{64} << 30;  // of meshes, cases and predictions
};

// ResourceExhausted with QUOTA_EXCEEDED: `what` is said in the message ("sessions"), `name` is that
// of the option.
absl::Status QuotaExceeded(absl::string_view what, absl::string_view name, int64_t limit,
                           std::chrono::steady_clock::duration try_again_after);

}  // namespace tissueform
