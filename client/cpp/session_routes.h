// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstddef>
#include <list>
#include <string>
#include <unordered_map>
#include <utility>

#include "absl/status/status.h"
#include "grpcpp/client_context.h"

#include "core/base/mutex.h"

namespace tissueform {

// The most sessions of which it is remembered where they are.
inline constexpr size_t kMaxSessionRoutes = 10'000;

// Which server of a cluster answered last for a session: its next call names that server in the
// header kNodeHeader, and a proxy sends it there. Names of sessions are "sessions/{id}".
//
// Keeps the sessions that were used last. Thread-safe.
class SessionRoutes {
 public:
  explicit SessionRoutes(size_t most = kMaxSessionRoutes) : most_(most) {}

  // Empty: not known.
  std::string NodeOf(const std::string& session);
  // Ignores a name that is not a valid header value, and an empty session.
  void Remember(const std::string& session, const std::string& node);
  void Forget(const std::string& session);
  // What an error says of it: with SESSION_MOVED and MEMORY_BUDGET_FULL where to go, if that is
  // known; where the server does not have it, or is away, it is forgotten.
  void LearnFrom(const absl::Status& error, const std::string& session);

  // A server has said its name, or that there are others. Those that are alone never do.
  bool in_cluster() const { return in_cluster_; }
  size_t size() const;

  // Adds the headers of the session's next call.
  void AddHeaders(const std::string& session, grpc::ClientContext* context);

 private:
  using Route = std::pair<std::string, std::string>;  // session and node

  const size_t most_;
  std::atomic<bool> in_cluster_ = false;

  mutable Mutex mutex_;
  std::list<Route> routes_ ABSL_GUARDED_BY(mutex_);  // used last: in front
  std::unordered_map<std::string, std::list<Route>::iterator> places_ ABSL_GUARDED_BY(mutex_);
};

// Where an error says that one should go: the server of the cluster that has what was asked for.
// Empty: it does not say.
std::string NodeIn(const absl::Status& error);

}  // namespace tissueform
