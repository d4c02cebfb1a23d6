// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <string>
#include <thread>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"

#include "client/pacs_bridge/audit/bridge_audit.h"
#include "client/pacs_bridge/audit/event_limit.h"
#include "client/pacs_bridge/network/instance_sink.h"
#include "core/base/mutex.h"

namespace tissueform {

// Audits who tries to come in: connections that the receiver refuses, and logins to the review
// page. Anyone can cause refusals, so that only some of each address are recorded in a minute; at
// its end one event says how many were not. Refusals are not recorded while the audit is full.
//
// Thread-safe; a thread of its own writes the event at the end of the minute.
class AccessAudit {
 public:
  struct Options {
    EventLimit::Options limit = {};
    // Silence after which the same user's next request counts as a new login.
    std::chrono::seconds max_silence{1800};
    size_t max_users = 1024;  // that are remembered; then the longest silent one is forgotten
  };

  // `audit` must outlive it.
  AccessAudit(BridgeAudit* audit, const Options& options);
  // Records at once how many refusals were left out.
  ~AccessAudit();
  AccessAudit(const AccessAudit&) = delete;
  AccessAudit& operator=(const AccessAudit&) = delete;

  void ConnectionRefused(const RefusedConnection& refused) ABSL_LOCKS_EXCLUDED(mutex_);
  // `user` is what the client states; may be empty.
  void LoginRefused(const std::string& address, const std::string& user)
      ABSL_LOCKS_EXCLUDED(mutex_);
  // A request with the right password: recorded once for each address and user until they are
  // silent. Errors: those of BridgeAudit::Reserve: it is not recorded and must not be served.
  absl::Status LoginAccepted(const std::string& address, const std::string& user)
      ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  using Clock = std::chrono::steady_clock;
  using User = std::pair<std::string, std::string>;  // address and name

  void WriteRefusal(AuditEvent event, const std::string& address) ABSL_LOCKS_EXCLUDED(mutex_);
  void WriteDropped() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Remember(const User& user, Clock::time_point now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Run() ABSL_LOCKS_EXCLUDED(mutex_);

  BridgeAudit* const audit_;
  const Options options_;

  Mutex mutex_;
  ConditionVariable changed_;
  EventLimit limit_ ABSL_GUARDED_BY(mutex_);
  std::map<User, Clock::time_point> last_seen_ ABSL_GUARDED_BY(mutex_);
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;  // last: it uses the others
};

}  // namespace tissueform
