// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

// Of http_server.cc alone.

#include <atomic>
#include <chrono>
#include <memory>
#include <unordered_map>
#include <utility>  // Boost.Asio 1.74 forgets it
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>

#include "client/gateway/http_server.h"
#include "core/base/mutex.h"

namespace tissueform {

// What the end of the gateway asks of a connection. Any thread.
class LiveConnection {
 public:
  virtual ~LiveConnection() = default;
  // Shall end soon.
  virtual void Drain() = 0;
  // Shall end now.
  virtual void Abort() = 0;
};

class LiveEntry;

// Which connections there are. Thread-safe.
class LiveConnections {
 public:
  void Add(const LiveEntry* entry, std::weak_ptr<LiveConnection> connection) {
    MutexLock lock(mutex_);
    connections_[entry] = std::move(connection);
  }
  void Remove(const LiveEntry* entry) {
    MutexLock lock(mutex_);
    connections_.erase(entry);
    if (connections_.empty()) empty_.NotifyAll();
  }
  std::vector<std::shared_ptr<LiveConnection>> All() const {
    MutexLock lock(mutex_);
    std::vector<std::shared_ptr<LiveConnection>> all;
    for (const auto& entry : connections_) {
      if (auto connection = entry.second.lock()) all.push_back(std::move(connection));
    }
    return all;
  }
  // False when there are some at the deadline.
  bool WaitUntilNone(std::chrono::steady_clock::time_point deadline) {
    MutexLock lock(mutex_);
    while (!connections_.empty()) {
      if (!empty_.WaitUntil(mutex_, deadline)) return connections_.empty();
    }
    return true;
  }

 private:
  mutable Mutex mutex_;
  ConditionVariable empty_;
  std::unordered_map<const LiveEntry*, std::weak_ptr<LiveConnection>> connections_
      ABSL_GUARDED_BY(mutex_);
};

// That a connection is there: its first member, so that all others are gone when the entry goes,
// which is what the end of the server waits for.
class LiveEntry {
 public:
  explicit LiveEntry(LiveConnections* connections) : connections_(connections) {}
  LiveEntry(const LiveEntry&) = delete;
  LiveEntry& operator=(const LiveEntry&) = delete;
  ~LiveEntry() { connections_->Remove(this); }

  void Set(std::weak_ptr<LiveConnection> connection) {
    connections_->Add(this, std::move(connection));
  }

 private:
  LiveConnections* const connections_;
};

// What all connections of a server share.
struct BeastContext {
  // Constant.
  GatewayLimits limits;
  HttpHandler* handler = nullptr;
  GatewayCounters* counters = nullptr;
  // Self-synchronised.
  boost::asio::io_context io = {};
  LiveConnections live = {};
  std::atomic<int> sockets = 0;
  std::atomic<bool> draining = false;
};

// How long a client may take for so much: nothing at all for the deadline, then 32 KiB a second.
inline std::chrono::seconds TimeToSend(const GatewayLimits& limits, size_t bytes) {
  return limits.stall_deadline + std::chrono::seconds(bytes >> 15);
}

}  // namespace tissueform
