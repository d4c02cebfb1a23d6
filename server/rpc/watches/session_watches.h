// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/access/auth/authenticator.h"
#include "server/rpc/watches/watch_channel.h"
#include "server/session/limits.h"
#include "server/session/session_registry.h"
#include "server/session/worker_pool.h"

namespace tissueform {

// The notice for streams of a server that drains and ends at `end`.
v1::DeformNotice DrainingAt(std::chrono::system_clock::time_point end);

// A watcher whose client acknowledges frames.
class CreditedWatcher : public Watcher {
 public:
  // `by`: the caller that acknowledges; its token may be newer than the watch's. Errors:
  // InvalidArgument (a frame that was not sent).
  virtual absl::Status Acknowledge(uint64_t number, const Authenticated& by) = 0;

 protected:
  ~CreditedWatcher() = default;
};

// The channels of a server by their sessions, and the open watches by their names: bounds their
// number and notifies them.
//
// Thread-safe. Its lock comes before those of channels and watchers.
class SessionWatches {
 public:
  // `pool` must outlive the watches and all their channels.
  SessionWatches(const ServiceLimits& limits, WorkerPool* pool) : limits_(limits), pool_(pool) {}

  // Lives as long as there is a drag or a watch.
  std::shared_ptr<WatchChannel> ChannelOf(const std::string& session_id);

  struct Joined {
    std::shared_ptr<WatchChannel> channel;
    bool has_frame = false;  // WatchChannel::Add
  };
  // `watcher` follows the session for `principal` under the id `watch`, which no other watch has.
  // Errors: ResourceExhausted.
  absl::StatusOr<Joined> Add(const std::string& watch, const std::string& session_id,
                             CreditedWatcher* watcher, const std::string& principal = "");
  // Nothing where it was not added.
  void Remove(const std::string& watch);

  // Errors: NotFound (also where the watch is another's), those of CreditedWatcher::Acknowledge.
  absl::Status Acknowledge(const std::string& watch, uint64_t number, const Authenticated& by = {});

  // As the registry's observer.
  void OnSessionEvent(const std::string& session_id, SessionEvent event);
  // From now on watches end with the drags.
  void NotifyDraining(std::chrono::system_clock::time_point end);

  std::map<std::string, int64_t> CountByPrincipal() const;
  int size() const;

 private:
  struct Watch {
    CreditedWatcher* watcher = nullptr;
    std::shared_ptr<WatchChannel> channel;
    std::string principal;
  };

  std::shared_ptr<WatchChannel> FindChannel(const std::string& session_id)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const ServiceLimits limits_;
  WorkerPool* const pool_;

  mutable Mutex mutex_;
  std::map<std::string, std::weak_ptr<WatchChannel>> channels_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, Watch> watches_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
