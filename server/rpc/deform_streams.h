// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/session/frame_scheduler.h"
#include "server/session/session_table.h"

namespace tissueform {

class DeformStreamReactor;

// The open Deform streams of a server: bounds their number and notifies them.
//
// Thread-safe. Its lock comes before the lock of a stream.
class DeformStreams {
 public:
  explicit DeformStreams(int max_streams) : max_streams_(max_streams) {}

  // Errors: ResourceExhausted.
  absl::Status Add(DeformStreamReactor* stream);
  // REQUIRES: added.
  void Remove(DeformStreamReactor* stream);

  void NotifyDraining(std::chrono::system_clock::time_point end);
  // As the registry's observer.
  void OnSessionEvent(const std::string& session_id, SessionEvent event);
  std::map<std::string, int64_t> CountByPrincipal() const;
  int size() const;

  // Of all streams there were.
  FrameMeasures& measures() { return measures_; }
  const FrameMeasures& measures() const { return measures_; }

 private:
  const int max_streams_;
  FrameMeasures measures_;

  mutable Mutex mutex_;
  std::set<DeformStreamReactor*> streams_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
