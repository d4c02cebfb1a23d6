// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <thread>

#include "grpcpp/client_context.h"

#include "core/base/cancellation.h"
#include "core/base/mutex.h"

namespace tissueform {

// While it is there, asks a Cancellation ten times a second and cancels a blocking call once that
// is requested. Made by the thread that calls, which is then free to block. The Cancellation is
// asked on a thread of this object.
class CallCanceller {
 public:
  CallCanceller(const Cancellation& cancellation, grpc::ClientContext* context);
  ~CallCanceller();
  CallCanceller(const CallCanceller&) = delete;
  CallCanceller& operator=(const CallCanceller&) = delete;

  // Whether it has cancelled the call.
  bool was_cancelled() const { return was_cancelled_; }

 private:
  void Watch() ABSL_LOCKS_EXCLUDED(mutex_);

  const Cancellation cancellation_;
  grpc::ClientContext* const context_;  // self-synchronized
  std::atomic<bool> was_cancelled_ = false;
  Mutex mutex_;
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;
  ConditionVariable has_ended_;
  std::thread thread_;  // last: begins when the others are there
};

}  // namespace tissueform
