// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/message_stream.h"

#include <atomic>
#include <chrono>
#include <future>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/mutex.h"
#include "tests/testing/fake_calls.h"
#include "tissueform/v1/prediction_service.pb.h"

// Without sockets: reactions come from threads that ThreadSanitizer sees through.
namespace tissueform::testing {
namespace {

using Message = v1::ReadPositionsResponse;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// The client takes so many messages, then it is gone, or takes nothing until the call is cancelled.
class LeavingClientCall : public grpc::ServerCallbackWriter<Message> {
 public:
  enum class Then { kGone, kTakesNothing };
  LeavingClientCall(WorkerPool* pool, size_t most, Then then = Then::kGone)
      : state_(pool), most_(most), then_(then) {}

  void Bind(MessageStream<Message>* stream) {
    stream_ = stream;
    BindReactor(stream);
    state_.Bind(stream);
  }
  // By the server.
  void Cancel() {
    {
      MutexLock lock(mutex_);
      ++cancellations_;
      if (!std::exchange(write_waits_, false)) return;
    }
    state_.React([this] { stream_->OnWriteDone(false); });
  }
  int cancellations() const {
    MutexLock lock(mutex_);
    return cancellations_;
  }
  std::optional<grpc::Status> WaitUntilDone() { return state_.WaitUntilDone(); }
  std::vector<int64_t> offsets() const {
    MutexLock lock(mutex_);
    return offsets_;
  }

  void Finish(grpc::Status status) override { state_.Finish(std::move(status)); }
  void SendInitialMetadata() override {}
  void Write(const Message* message, grpc::WriteOptions) override {
    state_.React([this, message] {
      bool ok = false;
      {
        MutexLock lock(mutex_);
        ok = offsets_.size() < most_;
        if (ok) offsets_.push_back(message->chunk().offset());
        write_waits_ = !ok && then_ == Then::kTakesNothing && cancellations_ == 0;
        if (write_waits_) return;
      }
      stream_->OnWriteDone(ok);
    });
  }
  void WriteAndFinish(const Message*, grpc::WriteOptions, grpc::Status) override {}

 private:
  grpc::internal::ServerReactor* reactor() override { return nullptr; }
  void CallOnDone() override {}

  MessageStream<Message>* stream_ = nullptr;  // constant after Bind
  FakeCallState state_;
  const size_t most_;
  const Then then_;
  mutable Mutex mutex_;
  std::vector<int64_t> offsets_ ABSL_GUARDED_BY(mutex_);
  bool write_waits_ ABSL_GUARDED_BY(mutex_) = false;
  int cancellations_ ABSL_GUARDED_BY(mutex_) = 0;
};

class MessageStreamTest : public ::testing::Test {
 protected:
  MessageStream<Message>* NewStream(
      CancelCall cancel = [] {}, std::chrono::milliseconds patience = std::chrono::minutes(1)) {
    return new MessageStream<Message>(CallScope(nullptr, "Test.Read", CallKind::kMetadata, &gate_),
                                      std::move(cancel), &timer_, patience);
  }

  static MessageStream<Message>::Next Offsets(int64_t count) {
    return [next = int64_t{0}, count](Message* message) mutable {
      message->mutable_chunk()->set_offset(next);
      return next++ < count;
    };
  }

  // No call is open.
  bool Idle() { return gate_.WaitUntilIdle(std::chrono::steady_clock::now()); }

  AdmissionControl gate_;
  DeadlineTimer timer_;
  WorkerPool reactions_{4};
};

TEST_F(MessageStreamTest, EveryMessageIsSentInOrderThenItEnds) {
  LeavingClientCall call(&reactions_, 100);
  MessageStream<Message>* stream = NewStream();
  call.Bind(stream);
  stream->Send(Offsets(4));
  const std::optional<grpc::Status> status = call.WaitUntilDone();
  ASSERT_TRUE(status.has_value());
  EXPECT_TRUE(status->ok());
  EXPECT_THAT(call.offsets(), ElementsAre(0, 1, 2, 3));
  EXPECT_TRUE(Idle());
}

TEST_F(MessageStreamTest, AClientThatIsGoneEndsIt) {
  LeavingClientCall call(&reactions_, 2);
  MessageStream<Message>* stream = NewStream();
  call.Bind(stream);
  stream->Send(Offsets(1'000'000));
  const std::optional<grpc::Status> status = call.WaitUntilDone();
  ASSERT_TRUE(status.has_value());
  EXPECT_EQ(status->error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_THAT(call.offsets(), ElementsAre(0, 1));
  EXPECT_TRUE(Idle());
}

TEST_F(MessageStreamTest, CancelsAClientThatReadsNothing) {
  LeavingClientCall call(&reactions_, 3, LeavingClientCall::Then::kTakesNothing);
  MessageStream<Message>* stream =
      NewStream([&call] { call.Cancel(); }, std::chrono::milliseconds(20));
  call.Bind(stream);
  stream->Send(Offsets(1'000'000));
  const std::optional<grpc::Status> status = call.WaitUntilDone();
  ASSERT_TRUE(status.has_value()) << "it waits for ever";
  EXPECT_EQ(status->error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_NE(status->error_message().find("in time"), std::string::npos);
  EXPECT_EQ(call.cancellations(), 1);
  EXPECT_THAT(call.offsets(), ElementsAre(0, 1, 2));
  EXPECT_TRUE(Idle());
}

// Every message has the whole time, and what was taken leaves no deadline behind.
TEST_F(MessageStreamTest, DoesNotCancelAClientThatReads) {
  constexpr std::chrono::milliseconds kPatience{500};
  LeavingClientCall call(&reactions_, 100);
  MessageStream<Message>* stream = NewStream([&call] { call.Cancel(); }, kPatience);
  call.Bind(stream);
  stream->Send(Offsets(50));
  const std::optional<grpc::Status> status = call.WaitUntilDone();
  ASSERT_TRUE(status.has_value());
  // Deadlines pass in their order: once this one has, those of the messages have.
  std::promise<void> passed;
  timer_.Start(std::chrono::steady_clock::now() + kPatience, [&passed] { passed.set_value(); });
  passed.get_future().wait();
  EXPECT_EQ(call.offsets().size(), 50U);
  EXPECT_TRUE(status->ok());
  EXPECT_EQ(call.cancellations(), 0);
}

// On a worker, so that a message may wait for the disk.
TEST_F(MessageStreamTest, MessagesAreMadeWhereTheyArePosted) {
  WorkerPool workers(1);
  std::atomic<int> posted = 0;
  LeavingClientCall call(&reactions_, 100);
  MessageStream<Message>* stream = NewStream();
  call.Bind(stream);
  stream->Send(Offsets(4), [&](WorkerPool::Job job) {
    ++posted;
    workers.Post(Lane::kStore, std::move(job));
  });
  const std::optional<grpc::Status> status = call.WaitUntilDone();
  ASSERT_TRUE(status.has_value());
  EXPECT_TRUE(status->ok());
  EXPECT_THAT(call.offsets(), ElementsAre(0, 1, 2, 3));
  EXPECT_EQ(posted, 5) << "the last finds none";
}

TEST_F(MessageStreamTest, EndsIfAMessageCannotBeMade) {
  LeavingClientCall call(&reactions_, 100);
  MessageStream<Message>* stream = NewStream();
  call.Bind(stream);
  stream->Send([next = int64_t{0}](Message* message) mutable -> absl::StatusOr<bool> {
    if (next == 2) return absl::DataLossError("damaged");
    message->mutable_chunk()->set_offset(next++);
    return true;
  });
  const std::optional<grpc::Status> status = call.WaitUntilDone();
  ASSERT_TRUE(status.has_value());
  EXPECT_EQ(status->error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_THAT(call.offsets(), ElementsAre(0, 1));
  EXPECT_TRUE(Idle());
}

TEST_F(MessageStreamTest, EndsWithAnErrorInPlaceOfMessages) {
  LeavingClientCall call(&reactions_, 100);
  MessageStream<Message>* stream = NewStream();
  call.Bind(stream);
  stream->End(absl::NotFoundError("nothing"));
  const std::optional<grpc::Status> status = call.WaitUntilDone();
  ASSERT_TRUE(status.has_value());
  EXPECT_EQ(status->error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(call.offsets(), IsEmpty());
}

}  // namespace
}  // namespace tissueform::testing
