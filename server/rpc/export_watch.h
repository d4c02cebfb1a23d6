// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <optional>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "server/exports/export_queue.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/calls/message_stream.h"
#include "server/session/deadline_timer.h"
#include "tissueform/v1/export_service.pb.h"

namespace tissueform {

v1::Export ToProto(const ExportRecord& record);

// One WatchExports call.
class ExportWatcher {
 public:
  virtual void OnChanged(const ExportRecord& record) = 0;
  virtual void EndWatch(const absl::Status& outcome) = 0;

 protected:
  ~ExportWatcher() = default;
};

// The open ones. Thread-safe. Its lock comes before those of watchers.
class ExportWatches {
 public:
  explicit ExportWatches(int most) : most_(most) {}

  // Errors: ResourceExhausted, Unavailable (draining).
  absl::Status Add(ExportWatcher* watcher);
  // Nothing where it was not added.
  void Remove(ExportWatcher* watcher);

  // To each.
  void OnChanged(const ExportRecord& record);
  // All end, and none begins any more.
  void NotifyDraining();

  int size() const;

 private:
  const int most_;

  mutable Mutex mutex_;
  std::set<ExportWatcher*> watchers_ ABSL_GUARDED_BY(mutex_);
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
};

// Sends each export that its caller may see once it is new or changed, in its latest state, with
// one write in flight. Deletes itself when gRPC is done with it. With the mutex held, watches and
// book are never called except to read.
class ExportWatch : public grpc::ServerWriteReactor<v1::WatchExportsResponse>,
                    public ExportWatcher {
 public:
  // A message that is not taken within `patience` is the last one. All pointers must outlive it.
  ExportWatch(CallScope scope, CancelCall cancel, std::chrono::milliseconds patience,
              const ExportQueue* book, ExportWatches* watches, DeadlineTimer* timer);

  void OnSendInitialMetadataDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  void OnChanged(const ExportRecord& record) override;
  void EndWatch(const absl::Status& outcome) override;

 private:
  using TimePoint = DeadlineTimer::TimePoint;

  // Whether its caller is still good, whether it takes messages, whether it is time for one.
  void Tick() ABSL_LOCKS_EXCLUDED(mutex_);
  void WaitForTick() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void End(const absl::Status& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Advance() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool NextMessage() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  CallScope scope_;  // ended by who calls Finish

  // Constant after the constructor.
  const CancelCall cancel_;
  const std::chrono::milliseconds patience_;
  const ExportQueue& book_;
  ExportWatches* const watches_;
  DeadlineTimer* const timer_;
  const std::optional<std::string> owner_;  // whose exports it sees; unset: all

  Mutex mutex_;
  bool opening_ ABSL_GUARDED_BY(mutex_) = true;
  v1::WatchExportsResponse message_ ABSL_GUARDED_BY(mutex_);  // gRPC's while one is written
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  TimePoint written_at_ ABSL_GUARDED_BY(mutex_);           // when the last message was begun
  std::set<std::string> changed_ ABSL_GUARDED_BY(mutex_);  // ids that are still to be sent
  bool sent_all_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  DeadlineTimer::Id tick_ ABSL_GUARDED_BY(mutex_);
  std::optional<absl::Status> outcome_ ABSL_GUARDED_BY(mutex_);  // set: nothing new is started
};

}  // namespace tissueform
