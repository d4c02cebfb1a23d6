// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/message_stream.h"

#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/mutex.h"
#include "tests/server/rpc/fake_calls.h"
#include "tissueform/v1/prediction_service.pb.h"

// Without sockets: reactions come from threads that ThreadSanitizer sees through.
namespace tissueform::testing {
namespace {

using Message = v1::ReadPositionsResponse;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// The client takes so many messages, then it is gone.
class FakeWriterCall : public grpc::ServerCallbackWriter<Message> {
 public:
  FakeWriterCall(WorkerPool* pool, size_t most) : state_(pool), most_(most) {}

  void Bind(MessageStream<Message>* stream) {
    stream_ = stream;
    BindReactor(stream);
    state_.Bind(stream);
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
  mutable Mutex mutex_;
  std::vector<int64_t> offsets_ ABSL_GUARDED_BY(mutex_);
};

class MessageStreamTest : public ::testing::Test {
 protected:
  MessageStream<Message>* NewStream() {
    return new MessageStream<Message>(CallScope(nullptr, "Test.Read", CallKind::kUpkeep, &gate_),
                                      nullptr, &timer_, std::chrono::minutes(1));
  }

  static MessageStream<Message>::Next Offsets(int64_t count) {
    return [next = int64_t{0}, count](Message* message) mutable {
      message->mutable_chunk()->set_offset(next);
      return next++ < count;
    };
  }

  // No call is open any longer.
  bool Idle() { return gate_.WaitUntilIdle(std::chrono::steady_clock::now()); }

  ServiceGate gate_;
  DeadlineTimer timer_;
  WorkerPool reactions_{4};
};

TEST_F(MessageStreamTest, EveryMessageIsSentInOrderThenItEnds) {
  FakeWriterCall call(&reactions_, 100);
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
  FakeWriterCall call(&reactions_, 2);
  MessageStream<Message>* stream = NewStream();
  call.Bind(stream);
  stream->Send(Offsets(1'000'000));
  const std::optional<grpc::Status> status = call.WaitUntilDone();
  ASSERT_TRUE(status.has_value());
  EXPECT_EQ(status->error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_THAT(call.offsets(), ElementsAre(0, 1));
  EXPECT_TRUE(Idle());
}

TEST_F(MessageStreamTest, AnErrorInPlaceOfMessagesIsItsEnd) {
  FakeWriterCall call(&reactions_, 100);
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
