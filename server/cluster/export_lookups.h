// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"

namespace tissueform {

// Decides whether the database is asked for an export that a call names and this server does not
// know: another server may have made it a moment ago, before its notice has come. Bounded, since
// anyone may name anything: at most kMaxAtOnce read at a time, what was not there is not looked for
// again for kRemembered, and nothing is while the database does not answer.
//
// Thread-safe. Calls block, for kPatience and as long as the read takes. Errors: Unavailable, where
// it cannot be found out.
class ExportLookups final {
 public:
  static constexpr int kMaxAtOnce = 4;
  static constexpr std::chrono::seconds kRemembered{1};
  static constexpr std::chrono::seconds kPatience{1};  // for one of the places

  // ExportQueue::ReadGate.
  absl::Status Read(const std::string& id, const std::function<absl::Status()>& read);

  // Exports that were looked for.
  int64_t lookups() const;

 private:
  // A place; false where it is known not to be there. Errors: Unavailable.
  absl::StatusOr<bool> Begin(const std::string& id);

  mutable Mutex mutex_;
  ConditionVariable place_;
  int reading_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t lookups_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, std::chrono::steady_clock::time_point> missing_ ABSL_GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point silent_until_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
