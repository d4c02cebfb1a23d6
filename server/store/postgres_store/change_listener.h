// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/store/postgres_store/postgres_connection.h"
#include "server/store/postgres_store/store_change.h"

namespace tissueform {

// Reports changes in their order, on a thread and a connection of its own. After some seconds
// without a change it checks whether the other end is there, and connects again without an answer
// (PostgresOptions::unanswered_timeout).
class ChangeListener {
 public:
  using Callback = std::function<void(const StoreChange&)>;

  // What is committed after it has returned is reported. Errors: those of PostgresConnection.
  static absl::StatusOr<std::unique_ptr<ChangeListener>> Start(const PostgresOptions& options,
                                                               Callback on_change);
  // Afterwards `on_change` is no longer called.
  ~ChangeListener();
  ChangeListener(const ChangeListener&) = delete;
  ChangeListener& operator=(const ChangeListener&) = delete;

 private:
  ChangeListener(PostgresTarget target, std::chrono::milliseconds unanswered, Callback on_change);

  // Errors: those of PostgresConnection; then there is no connection.
  absl::Status Connect() ABSL_LOCKS_EXCLUDED(mutex_);
  void Loop();
  // The notices that came; empty after a while without. Errors: the connection is no longer usable.
  absl::StatusOr<std::vector<std::string>> Wait();
  // False at the end.
  bool ConnectAgain();
  bool ending();
  // Gives the connection up when it is not answered.
  void Watch();

  const PostgresTarget target_;
  const std::chrono::milliseconds unanswered_;
  const Callback on_change_;
  Mutex mutex_;
  ConditionVariable changed_;
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;  // its thread has
  // Used by its thread without the lock, and changed with it.
  std::unique_ptr<PostgresConnection> connection_;
  std::chrono::steady_clock::time_point heard_ = std::chrono::steady_clock::now();
  // Last: they use the others.
  std::thread watch_;
  std::thread thread_;
};

}  // namespace tissueform
