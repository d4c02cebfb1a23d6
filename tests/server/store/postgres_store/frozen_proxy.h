// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/string_view.h"

#include "core/base/mutex.h"

namespace tissueform::testing {

// Stands between a server and a database. Once frozen the connections that there are stay open and
// nothing comes through them any more; new ones are forwarded.
class FrozenProxy {
 public:
  // To 127.0.0.1 and this port; on a port of its own.
  explicit FrozenProxy(int port);
  ~FrozenProxy();
  FrozenProxy(const FrozenProxy&) = delete;
  FrozenProxy& operator=(const FrozenProxy&) = delete;

  int port() const { return port_; }
  void Freeze();
  // New ones too, until Thaw; those that were frozen stay so.
  void FreezeAll();
  void Thaw() {
    shut_ = false;
    shut_when_ready_ = false;
  }
  // New ones once they stand, before the first statement, until Thaw. Without TLS.
  void FreezeWhenReady() { shut_when_ready_ = true; }
  // The first connection on which this comes from a client, which is not forwarded. Without TLS.
  void FreezeAt(const std::string& text);
  int accepted() const { return accepted_; }

 private:
  void Accept();
  bool StopsAt(absl::string_view bytes);
  void Forward(int client, int generation, bool until_ready);

  const int database_port_;
  int listener_ = -1;
  int port_ = 0;
  std::atomic<int> generation_ = 0;
  std::atomic<int> accepted_ = 0;
  std::atomic<bool> shut_ = false;
  std::atomic<bool> shut_when_ready_ = false;
  std::atomic<bool> ending_ = false;
  Mutex mutex_;
  std::string stop_at_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::thread> threads_ ABSL_GUARDED_BY(mutex_);
  std::thread accepting_;
};

}  // namespace tissueform::testing
