// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

#include "core/base/mutex.h"
#include "server/platform/audit/audit_log.h"
#include "server/rpc/calls/call_observer.h"

namespace tissueform {

// Writes which caller has called what into an audit log, as one JSON object per event: every call
// when it ends, a stream also when it opens and when it names its resource. Nothing of what a call
// sends or receives goes there.
//
// Left out are calls that touch no content: what the server is (GetServerInfo), the caller's name
// (WhoAmI), and the acknowledgements of a watch. All others are refused while the log cannot be
// written, also those that only read: an audit must not miss a single read.
//
// Calls that were never let in (not known, draining, refused here) are logged, too, but only so
// many a second; of the rest only the number.
//
// Thread-safe.
class AuditObserver final : public CallObserver {
 public:
  static constexpr int kRefusedLinesASecond = 20;

  // For AuditLog::Options: so many events found no room.
  static std::string LostEvent(int64_t count);

  // `log` must outlive it.
  explicit AuditObserver(
      AuditLog* log, std::function<absl::Time()> now = [] { return absl::Now(); });
  ~AuditObserver() override;

  // Errors: those of AuditLog::Reserve.
  absl::Status OnBegin(const ObservedCall& call) override;
  void OnResource(const ObservedCall& call) override;
  void OnEnd(const ObservedCall& call, const absl::Status& outcome,
             std::chrono::steady_clock::duration elapsed) override;

 private:
  bool IsLeftOut(std::string_view method) const { return left_out_.contains(method); }
  bool IsStream(std::string_view method) const { return streams_.contains(method); }
  // Whether one more refused call gets a line of its own.
  bool MayWriteRefusal() ABSL_LOCKS_EXCLUDED(mutex_);
  void WriteSkippedRefusals(absl::Time now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  AuditLog* const log_;
  const std::function<absl::Time()> now_;
  const std::set<std::string, std::less<>> left_out_;
  const std::set<std::string, std::less<>> streams_;

  Mutex mutex_;
  int64_t second_ ABSL_GUARDED_BY(mutex_) = 0;  // of the last refused call
  int written_ ABSL_GUARDED_BY(mutex_) = 0;     // in that second
  int64_t skipped_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace tissueform
