// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/server_callback.h"

#include "server/rpc/calls/call_scope.h"
#include "server/session/deadline_timer.h"

namespace tissueform {

// Ends a call whose client takes nothing, from any thread. Nothing where there is no network.
using CancelCall = std::function<void()>;
inline CancelCall CancelOf(grpc::CallbackServerContext* context) {
  return [context] {
    if (context != nullptr) context->TryCancel();
  };
}

// A call that answers with messages, each made when the client has taken the one before. Deletes
// itself when gRPC is done with it.
//
// One thing at a time is under way: work before the first message, a write, or the end. Beside
// them runs the timer, which cancels the call of a client that takes nothing.
template <typename Response>
class MessageStream : public grpc::ServerWriteReactor<Response> {
 public:
  // Makes the next message; false when there are no more. An error ends the call.
  using Next = std::function<absl::StatusOr<bool>(Response* message)>;
  // Runs a job elsewhere.
  using Post = std::function<void(std::function<void()> job)>;

  // A message that is not taken within `patience` is the last one. `timer` must outlive the call.
  MessageStream(CallScope scope, CancelCall cancel, DeadlineTimer* timer,
                std::chrono::milliseconds patience)
      : scope_(std::move(scope)), cancel_(std::move(cancel)), timer_(timer), patience_(patience) {}

  // Used by the thread that works on the call.
  CallScope& scope() { return scope_; }

  // One of the two, once, from any thread. `next` is called from threads of gRPC, so not long; or
  // by `post`, where it may block.
  void Send(Next next, Post post = nullptr) {
    next_ = std::move(next);
    post_ = std::move(post);
    WriteNext();
  }
  void End(const absl::Status& outcome) {
    next_ = nullptr;  // what it holds is free when the client hears of the end
    this->Finish(scope_.End(outcome));
  }

  void OnWriteDone(bool ok) override {
    handed_over_.load(std::memory_order_acquire);
    timer_->Cancel(deadline_);
    if (ok) {
      WriteNext();
    } else {
      End(absl::CancelledError("the client canceled the call, or read no message in time"));
    }
  }

  void OnDone() override { delete this; }

 protected:
  ~MessageStream() override = default;

 private:
  void WriteNext() {
    if (post_ == nullptr) {
      MakeAndWrite();
    } else {
      const Post post = post_;  // the job may end this object before it is posted here
      post([this] { MakeAndWrite(); });
    }
  }

  void MakeAndWrite() {
    message_.Clear();
    const absl::StatusOr<bool> made = next_(&message_);
    if (!made.ok() || !*made) {
      End(made.status());
      return;
    }
    // Before the write, which may be done at once.
    deadline_ = timer_->Start(std::chrono::steady_clock::now() + patience_, cancel_);
    handed_over_.store(true, std::memory_order_release);
    this->StartWrite(&message_);
  }

  CallScope scope_;
  const CancelCall cancel_;
  DeadlineTimer* const timer_;
  const std::chrono::milliseconds patience_;
  Next next_;
  Post post_;         // null: where it is asked
  Response message_;  // gRPC's while a write is under way
  DeadlineTimer::Id deadline_;
  // A write begins on one thread and ends on another. gRPC orders the two, but inside a library
  // that ThreadSanitizer cannot see into; this it sees.
  std::atomic<bool> handed_over_ = false;
};

}  // namespace tissueform
