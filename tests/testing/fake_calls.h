// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <optional>
#include <utility>

#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "server/session/worker_pool.h"

// gRPC's side of a call without gRPC: reactions come concurrently from the threads of a pool, in
// any order that gRPC allows. Everything is code that ThreadSanitizer sees, so that it finds races
// of a reactor which it cannot distinguish from the library's own in a test with sockets.
namespace tissueform::testing {

// What all kinds of calls have in common: operations under way, cancellation and the end.
class FakeCallState {
 public:
  explicit FakeCallState(WorkerPool* pool) : pool_(pool) {}

  // Must be called once, when the handler has returned.
  void Bind(grpc::internal::ServerReactor* reactor);

  // Runs a reaction on the pool; OnDone waits for it.
  void React(WorkerPool::Job reaction);
  void Finish(grpc::Status status);
  void Cancel();

  bool cancelled() const;
  // Blocks until OnDone has been called; empty when that takes more than 30 s.
  std::optional<grpc::Status> WaitUntilDone();

 private:
  void Ended() ABSL_LOCKS_EXCLUDED(mutex_);

  WorkerPool* const pool_;
  mutable Mutex mutex_;
  ConditionVariable changed_;
  grpc::internal::ServerReactor* reactor_ ABSL_GUARDED_BY(mutex_) = nullptr;
  int reactions_under_way_ ABSL_GUARDED_BY(mutex_) = 1;  // one stands for the handler
  bool cancelled_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<grpc::Status> status_ ABSL_GUARDED_BY(mutex_);
  bool done_ ABSL_GUARDED_BY(mutex_) = false;
};

class FakeUnaryCall : public grpc::ServerCallbackUnary {
 public:
  explicit FakeUnaryCall(WorkerPool* pool) : state_(pool) {}

  void Bind(grpc::ServerUnaryReactor* reactor) {
    BindReactor(reactor);
    state_.Bind(reactor);
  }
  void Cancel() { state_.Cancel(); }
  std::optional<grpc::Status> WaitUntilDone() { return state_.WaitUntilDone(); }

  void Finish(grpc::Status status) override { state_.Finish(std::move(status)); }
  void SendInitialMetadata() override {}

 private:
  grpc::internal::ServerReactor* reactor() override { return nullptr; }
  void CallOnDone() override {}

  FakeCallState state_;
};

// Messages on their way from a client to a reactor, one read at a time.
template <typename Request>
class FakeReads {
 public:
  using OnReadDone = std::function<void(bool)>;

  FakeReads(FakeCallState* state, OnReadDone done) : state_(state), done_(std::move(done)) {}

  void Send(Request message) {
    MutexLock lock(mutex_);
    messages_.push_back(std::move(message));
    Deliver();
  }
  // The client sends no more, or is gone.
  void Close() {
    MutexLock lock(mutex_);
    closed_ = true;
    Deliver();
  }
  void Read(Request* target) {
    MutexLock lock(mutex_);
    target_ = target;
    Deliver();
  }

 private:
  void Deliver() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (target_ == nullptr) return;
    if (!messages_.empty() && !state_->cancelled()) {
      state_->React([this, target = target_, message = std::move(messages_.front())]() mutable {
        *target = std::move(message);
        done_(true);
      });
      messages_.pop_front();
    } else if (closed_ || state_->cancelled()) {
      state_->React([this] { done_(false); });
    } else {
      return;
    }
    target_ = nullptr;
  }

  FakeCallState* const state_;
  const OnReadDone done_;
  Mutex mutex_;
  std::deque<Request> messages_ ABSL_GUARDED_BY(mutex_);
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  Request* target_ ABSL_GUARDED_BY(mutex_) = nullptr;
};

template <typename Request>
class FakeReaderCall : public grpc::ServerCallbackReader<Request> {
 public:
  explicit FakeReaderCall(WorkerPool* pool)
      : state_(pool), reads_(&state_, [this](bool ok) { reactor_->OnReadDone(ok); }) {}

  void Bind(grpc::ServerReadReactor<Request>* reactor) {
    reactor_ = reactor;
    this->BindReactor(reactor);
    state_.Bind(reactor);
  }
  void Send(Request message) { reads_.Send(std::move(message)); }
  void CloseSending() { reads_.Close(); }
  void Cancel() {
    state_.Cancel();
    reads_.Close();
  }
  std::optional<grpc::Status> WaitUntilDone() { return state_.WaitUntilDone(); }

  void Finish(grpc::Status status) override {
    reads_.Close();
    state_.Finish(std::move(status));  // last: the test may destroy this object afterwards
  }
  void SendInitialMetadata() override {}
  void Read(Request* target) override { reads_.Read(target); }

 private:
  grpc::internal::ServerReactor* reactor() override { return nullptr; }
  void CallOnDone() override {}

  grpc::ServerReadReactor<Request>* reactor_ = nullptr;  // constant after Bind
  FakeCallState state_;
  FakeReads<Request> reads_;
};

// Messages on their way from a reactor to a client. Each is read at once unless the client has
// stopped.
template <typename Response>
class FakeWrites {
 public:
  using OnWriteDone = std::function<void(bool)>;

  FakeWrites(FakeCallState* state, OnWriteDone done) : state_(state), done_(std::move(done)) {}

  void Write(const Response* message) {
    MutexLock lock(mutex_);
    ++started_;
    if (stalled_) {
      stalled_write_ = message;
    } else {
      Complete(message);
    }
  }
  // From now on writes do not complete, until ReadOn: the client does not read.
  void StopReading() {
    MutexLock lock(mutex_);
    stalled_ = true;
  }
  void ReadOn() {
    MutexLock lock(mutex_);
    stalled_ = false;
    if (stalled_write_ != nullptr) Complete(std::exchange(stalled_write_, nullptr));
  }
  // The next message of the server; empty when the call has ended, or after 30 s.
  std::optional<Response> Receive() {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    MutexLock lock(mutex_);
    while (responses_.empty() && !ended_) {
      if (!changed_.WaitUntil(mutex_, deadline)) return std::nullopt;
    }
    if (responses_.empty()) return std::nullopt;
    Response response = std::move(responses_.front());
    responses_.pop_front();
    return response;
  }
  bool HasUnread() const {
    MutexLock lock(mutex_);
    return !responses_.empty();
  }
  int started() const {
    MutexLock lock(mutex_);
    return started_;
  }
  void End() {
    MutexLock lock(mutex_);
    ended_ = true;
    changed_.NotifyAll();
  }

 private:
  void Complete(const Response* message) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    state_->React([this, message] {
      const bool ok = !state_->cancelled();
      if (ok) {
        MutexLock lock(mutex_);
        responses_.push_back(*message);
        changed_.NotifyAll();
      }
      done_(ok);
    });
  }

  FakeCallState* const state_;
  const OnWriteDone done_;
  mutable Mutex mutex_;
  ConditionVariable changed_;
  std::deque<Response> responses_ ABSL_GUARDED_BY(mutex_);
  const Response* stalled_write_ ABSL_GUARDED_BY(mutex_) = nullptr;
  bool stalled_ ABSL_GUARDED_BY(mutex_) = false;
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;
  int started_ ABSL_GUARDED_BY(mutex_) = 0;
};

// A call whose server alone speaks.
template <typename Response>
class FakeWriterCall : public grpc::ServerCallbackWriter<Response> {
 public:
  explicit FakeWriterCall(WorkerPool* pool)
      : state_(pool), writes_(&state_, [this](bool ok) { reactor_->OnWriteDone(ok); }) {}

  void Bind(grpc::ServerWriteReactor<Response>* reactor) {
    reactor_ = reactor;
    this->BindReactor(reactor);
    state_.Bind(reactor);
  }
  void Cancel() {
    state_.Cancel();
    writes_.ReadOn();
  }
  void StopReading() { writes_.StopReading(); }
  void ReadOn() { writes_.ReadOn(); }
  std::optional<Response> Receive() { return writes_.Receive(); }
  bool HasUnread() const { return writes_.HasUnread(); }
  std::optional<grpc::Status> WaitUntilDone() { return state_.WaitUntilDone(); }

  void Finish(grpc::Status status) override {
    writes_.End();
    state_.Finish(std::move(status));  // last: the test may destroy this object afterwards
  }
  void SendInitialMetadata() override {
    state_.React([this] { reactor_->OnSendInitialMetadataDone(!state_.cancelled()); });
  }
  void Write(const Response* message, grpc::WriteOptions) override { writes_.Write(message); }
  void WriteAndFinish(const Response*, grpc::WriteOptions, grpc::Status) override {}

 private:
  grpc::internal::ServerReactor* reactor() override { return nullptr; }
  void CallOnDone() override {}

  grpc::ServerWriteReactor<Response>* reactor_ = nullptr;  // constant after Bind
  FakeCallState state_;
  FakeWrites<Response> writes_;
};

template <typename Request, typename Response>
class FakeBidiCall : public grpc::ServerCallbackReaderWriter<Request, Response> {
 public:
  explicit FakeBidiCall(WorkerPool* pool)
      : state_(pool),
        reads_(&state_, [this](bool ok) { reactor_->OnReadDone(ok); }),
        writes_(&state_, [this](bool ok) { reactor_->OnWriteDone(ok); }) {}

  void Bind(grpc::ServerBidiReactor<Request, Response>* reactor) {
    reactor_ = reactor;
    this->BindReactor(reactor);
    state_.Bind(reactor);
  }
  void Send(Request message) { reads_.Send(std::move(message)); }
  void CloseSending() { reads_.Close(); }
  void Cancel() {
    state_.Cancel();
    reads_.Close();
    writes_.ReadOn();
  }
  void StopReading() { writes_.StopReading(); }
  void ReadOn() { writes_.ReadOn(); }
  std::optional<Response> Receive() { return writes_.Receive(); }
  int writes_started() const { return writes_.started(); }
  std::optional<grpc::Status> WaitUntilDone() { return state_.WaitUntilDone(); }

  void Finish(grpc::Status status) override {
    writes_.End();
    reads_.Close();
    state_.Finish(std::move(status));  // last: the test may destroy this object afterwards
  }
  void SendInitialMetadata() override {}
  void Read(Request* target) override { reads_.Read(target); }
  void Write(const Response* message, grpc::WriteOptions) override { writes_.Write(message); }
  void WriteAndFinish(const Response*, grpc::WriteOptions, grpc::Status) override {}

 private:
  grpc::internal::ServerReactor* reactor() override { return nullptr; }
  void CallOnDone() override {}

  grpc::ServerBidiReactor<Request, Response>* reactor_ = nullptr;  // constant after Bind
  FakeCallState state_;
  FakeReads<Request> reads_;
  FakeWrites<Response> writes_;
};

}  // namespace tissueform::testing
