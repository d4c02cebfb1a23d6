// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/postgres_store/postgres_connection.h"
#include "server/postgres_store/store_change.h"

namespace tissueform {

// Tells changes in their order, on a thread and a connection of its own.
class ChangeListener {
 public:
  using Callback = std::function<void(const StoreChange&)>;

  // What is committed after it has returned is told. Errors: those of PostgresConnection::Open.
  static absl::StatusOr<std::unique_ptr<ChangeListener>> Start(const PostgresOptions& options,
                                                               Callback told);
  // `told` is not called any longer.
  ~ChangeListener();
  ChangeListener(const ChangeListener&) = delete;
  ChangeListener& operator=(const ChangeListener&) = delete;

 private:
  ChangeListener(PostgresTarget target, Callback told,
                 std::unique_ptr<PostgresConnection> connection);

  void Loop(std::unique_ptr<PostgresConnection> connection);
  // A connection that listens, as soon as there is one; null at the end.
  std::unique_ptr<PostgresConnection> ConnectAgain();
  bool ending();

  const PostgresTarget target_;
  const Callback told_;
  Mutex mutex_;
  ConditionVariable changed_;
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;  // last: it uses the others
};

}  // namespace tissueform
