// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/call_canceller.h"

#include <chrono>

namespace tissueform {
namespace {

constexpr std::chrono::milliseconds kAsk{100};

}  // namespace

CallCanceller::CallCanceller(const Cancellation& cancellation, grpc::ClientContext* context)
    : cancellation_(cancellation), context_(context), thread_([this] { Watch(); }) {}

CallCanceller::~CallCanceller() {
  {
    const MutexLock lock(mutex_);
    ended_ = true;
  }
  has_ended_.NotifyAll();
  thread_.join();
}

void CallCanceller::Watch() {
  const MutexLock lock(mutex_);
  while (!ended_ && !was_cancelled_) {
    has_ended_.WaitUntil(mutex_, std::chrono::steady_clock::now() + kAsk);
    if (ended_ || !cancellation_.requested()) continue;
    was_cancelled_ = true;
    context_->TryCancel();
  }
}

}  // namespace tissueform
