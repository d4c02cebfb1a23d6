// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/fake_calls.h"

namespace tissueform::testing {

void FakeCallState::Bind(grpc::internal::ServerReactor* reactor) {
  {
    MutexLock lock(mutex_);
    reactor_ = reactor;
    if (cancelled_) {
      ++reactions_under_way_;
      pool_->Post(Lane::kBatch, [this, reactor] {
        reactor->OnCancel();
        Ended();
      });
    }
  }
  Ended();
}

void FakeCallState::React(WorkerPool::Job reaction) {
  {
    MutexLock lock(mutex_);
    ++reactions_under_way_;
  }
  pool_->Post(Lane::kBatch, [this, reaction = std::move(reaction)] {
    reaction();
    Ended();
  });
}

void FakeCallState::Finish(grpc::Status status) {
  {
    MutexLock lock(mutex_);
    ++reactions_under_way_;
    // What the client sees: its own cancellation, even if the server says something else later. A
    // read that fails before OnCancel looks to a reactor like the end of sending, and may end well.
    status_ = cancelled_ ? grpc::Status(grpc::StatusCode::CANCELLED, "cancelled by the client")
                         : std::move(status);
  }
  // Not from here: the caller may hold locks of the reactor.
  pool_->Post(Lane::kBatch, [this] { Ended(); });
}

void FakeCallState::Cancel() {
  MutexLock lock(mutex_);
  if (std::exchange(cancelled_, true) || done_ || reactor_ == nullptr ||
      (status_.has_value() && reactions_under_way_ == 0)) {
    return;
  }
  ++reactions_under_way_;
  pool_->Post(Lane::kBatch, [this, reactor = reactor_] {
    reactor->OnCancel();
    Ended();
  });
}

bool FakeCallState::cancelled() const {
  MutexLock lock(mutex_);
  return cancelled_;
}

std::optional<grpc::Status> FakeCallState::WaitUntilDone() {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  MutexLock lock(mutex_);
  while (!done_) {
    if (!changed_.WaitUntil(mutex_, deadline)) {
      return std::nullopt;
    }
  }
  return status_;
}

void FakeCallState::Ended() {
  grpc::internal::ServerReactor* reactor = nullptr;
  {
    MutexLock lock(mutex_);
    if (--reactions_under_way_ > 0 || !status_.has_value()) {
      return;
    }
    reactor = reactor_;
  }
  reactor->OnDone();
  MutexLock lock(mutex_);
  done_ = true;
  changed_.NotifyAll();
}

}  // namespace tissueform::testing
