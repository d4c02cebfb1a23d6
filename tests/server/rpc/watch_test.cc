// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <chrono>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "grpcpp/impl/codegen/proto_utils.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "proto/conversion/geometry_conversion.h"
#include "server/rpc/watch_stream.h"
#include "tests/server/rpc/reactors_fixture.h"
#include "tests/server/rpc/watch_call.h"
#include "tests/testing/status_matchers.h"

// Watching without sockets.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

class WatchTest : public ReactorsTest {
 protected:
  WatchTest() {
    registry_.table().set_observer(
        [this](const std::string& id, SessionEvent event) { watches_.OnSessionEvent(id, event); });
  }

  std::unique_ptr<WatchCall> Watch(const std::string& session,
                                   std::optional<int> max_unacked = {}) {
    return std::make_unique<WatchCall>(reactions_.get(), &deform_service_, session, max_unacked);
  }
  std::unique_ptr<FakeStream> Drag(const std::string& session) {
    auto stream = std::make_unique<FakeStream>(reactions_.get());
    stream->Bind(deform_service_.Deform(nullptr));
    stream->Send(Configuration(session));
    EXPECT_TRUE(stream->Receive()->has_started());
    return stream;
  }
  // The next message, but for who follows.
  static std::optional<v1::DeformResponse> Next(FakeStream* stream) {
    for (;;) {
      std::optional<v1::DeformResponse> response = stream->Receive();
      if (!response.has_value() || !response->notice().has_followers()) return response;
    }
  }
  // The next number of followers that the drag receives.
  static int Followers(FakeStream* stream) {
    const std::optional<v1::DeformResponse> response = stream->Receive();
    EXPECT_TRUE(response.has_value() && response->notice().has_followers());
    return response.has_value() ? response->notice().followers().count() : -1;
  }
  // Sends a pose and returns what the drag is shown.
  static v1::DeformFrame Move(FakeStream* stream, uint64_t sequence) {
    stream->Send(Pose(sequence));
    const auto response = Next(stream);
    EXPECT_TRUE(response.has_value() && response->has_frame());
    stream->Send(Ack(sequence));
    return response.value_or(v1::DeformResponse()).frame();
  }
  static void EndDrag(std::unique_ptr<FakeStream> stream) {
    stream->CloseSending();
    EXPECT_FALSE(Next(stream.get()).has_value());
    EXPECT_TRUE(stream->WaitUntilDone()->ok());
  }
};

TEST_F(WatchTest, TwoWatchersSeeEveryFrameOfADragAsSent) {
  const std::string session = MakeSession();
  auto one = Watch(session);
  auto other = Watch(session);
  const std::string id = one->Begin(v1::WATCH_ORIGIN_REST);
  const std::string other_id = other->Begin(v1::WATCH_ORIGIN_REST);
  auto drag = Drag(session);
  for (uint64_t sequence = 1; sequence <= 20; ++sequence) {
    const v1::DeformFrame sent = Move(drag.get(), sequence);
    if (sequence == 1) {
      EXPECT_EQ(one->Receive()->form().vertex_count(), sample_.mesh.num_vertices());
      EXPECT_TRUE(other->Receive()->has_form());
    }
    const auto seen = one->Receive();
    ASSERT_TRUE(seen.has_value() && seen->has_frame());
    EXPECT_EQ(seen->frame().origin(), v1::WATCH_ORIGIN_DRAG);
    EXPECT_EQ(seen->frame().frame().SerializeAsString(), sent.SerializeAsString());
    ASSERT_TRUE(other->Receive().has_value());
    EXPECT_EQ(one->LastBytes(), other->LastBytes()) << "encoded once";
    EXPECT_THAT(watches_.Acknowledge(id, seen->frame().number()), IsOk());
    EXPECT_THAT(watches_.Acknowledge(other_id, seen->frame().number()), IsOk());
  }
  EndDrag(std::move(drag));
  one->Cancel();
  other->Cancel();
  EXPECT_EQ(one->WaitUntilDone()->error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(other->WaitUntilDone()->error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(watches_.size(), 0);
}

TEST_F(WatchTest, DragIsToldItsNumberOfFollowers) {
  const std::string session = MakeSession();
  const std::unique_ptr<WatchCall> first = Watch(session);
  first->Begin(v1::WATCH_ORIGIN_REST);
  std::unique_ptr<FakeStream> drag = Drag(session);
  EXPECT_EQ(Followers(drag.get()), 1) << "who was there before it";
  const std::unique_ptr<WatchCall> second = Watch(session);
  EXPECT_EQ(Followers(drag.get()), 2);
  std::unique_ptr<FakeStream> other_drag = Drag(session);
  EXPECT_EQ(Followers(other_drag.get()), 2);
  second->Cancel();
  second->WaitUntilDone();
  EXPECT_EQ(Followers(drag.get()), 1);
  EXPECT_EQ(Followers(other_drag.get()), 1);
  first->Cancel();
  first->WaitUntilDone();
  EXPECT_EQ(Followers(drag.get()), 0);
  Move(drag.get(), 1);
  EndDrag(std::move(drag));
  EndDrag(std::move(other_drag));
}

TEST_F(WatchTest, DragWithoutFollowersGetsNoNotice) {
  const std::string session = MakeSession();
  const std::unique_ptr<FakeStream> drag = Drag(session);
  drag->Send(Pose(1));
  EXPECT_TRUE(drag->Receive()->has_frame());
  drag->CloseSending();
  EXPECT_FALSE(drag->Receive().has_value());
  EXPECT_TRUE(drag->WaitUntilDone()->ok());
}

// Regardless of what is under way when it ends.
TEST_F(WatchTest, DragsAndFollowersComeAndGoAtOnce) {
  const std::string session = MakeSession();
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      for (int round = 0; round < 10; ++round) {
        if (i % 2 == 0) {
          const std::unique_ptr<FakeStream> drag = Drag(session);
          drag->Cancel();
          drag->WaitUntilDone();
        } else {
          const std::unique_ptr<WatchCall> watch = Watch(session);
          watch->Cancel();
          watch->WaitUntilDone();
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(watches_.size(), 0);
}

TEST_F(WatchTest, WithoutADragTheFirstFrameIsTheSkinAtRestOrAsItWasCommitted) {
  const std::string session = MakeSession();
  auto at_rest = Watch(session);
  at_rest->Begin(v1::WATCH_ORIGIN_REST);
  const std::vector<int32_t> skin = catalog_.Find(sample_.Announcement().sha256)->skin;
  const VertexChoice choice{.all = false, .vertices = skin};
  const Positions& rest = sample_.mesh.positions();
  EXPECT_EQ(at_rest->first().frame().positions(),
            EncodePositions(rest, choice, v1::POSITION_ENCODING_FLOAT32, rest).bytes);
  at_rest->Cancel();
  at_rest->WaitUntilDone();

  // Of another session: here the frames of a drag are kept as long as the watch before is being
  // ended.
  const std::string moved = MakeSession();
  auto drag = Drag(moved);
  v1::DeformRequest pose = Pose(64);
  pose.mutable_pose()->set_commit(true);
  drag->Send(pose);
  drag->CloseSending();
  while (drag->Receive().has_value()) {
  }
  EXPECT_TRUE(drag->WaitUntilDone()->ok());
  auto committed = Watch(moved);
  committed->Begin(v1::WATCH_ORIGIN_COMMITTED);
  const std::string& bytes = committed->first().frame().positions();
  ASSERT_EQ(bytes.size(), skin.size() * 12);
  float z = 0;
  std::memcpy(&z, bytes.data() + bytes.size() - sizeof(z), sizeof(z));
  EXPECT_NEAR(z, rest(skin.back(), 2) + 1, 1e-5);
  committed->Cancel();
  EXPECT_TRUE(committed->WaitUntilDone().has_value());
}

TEST_F(WatchTest, ALateWatchReceivesTheNewestFrame) {
  const std::string session = MakeSession();
  auto early = Watch(session);
  const std::string early_id = early->Begin(v1::WATCH_ORIGIN_REST);
  auto drag = Drag(session);
  v1::DeformFrame sent;
  // Watches are given a frame just after the drag is: what `early` has seen is theirs.
  for (uint64_t sequence = 1; sequence <= 3; ++sequence) {
    sent = Move(drag.get(), sequence);
    if (sequence == 1) {
      EXPECT_TRUE(early->Receive()->has_form());
    }
    const auto seen = early->Receive();
    EXPECT_EQ(seen->frame().frame().sequence(), sequence);
    EXPECT_THAT(watches_.Acknowledge(early_id, seen->frame().number()), IsOk());
  }
  auto watch = Watch(session);
  watch->Begin(v1::WATCH_ORIGIN_DRAG);
  EXPECT_EQ(watch->first().frame().SerializeAsString(), sent.SerializeAsString());
  for (const auto& one : {watch.get(), early.get()}) {
    one->Cancel();
    EXPECT_TRUE(one->WaitUntilDone().has_value());
  }
  EndDrag(std::move(drag));
}

TEST_F(WatchTest, SlowWatchGetsOnlyTheNewestFrameAndDelaysNoOther) {
  const std::string session = MakeSession();
  auto slow = Watch(session, 1);
  const std::string id = slow->Begin(v1::WATCH_ORIGIN_REST);
  auto quick = Watch(session);
  const std::string quick_id = quick->Begin(v1::WATCH_ORIGIN_REST);
  auto drag = Drag(session);
  constexpr uint64_t kLast = 50;
  for (uint64_t sequence = 1; sequence <= kLast; ++sequence) {
    const v1::DeformFrame sent = Move(drag.get(), sequence);
    if (sequence == 1) {
      EXPECT_TRUE(quick->Receive()->has_form());
    }
    const auto seen = quick->Receive();
    ASSERT_TRUE(seen.has_value());
    EXPECT_EQ(seen->frame().frame().sequence(), sequence);
    EXPECT_THAT(watches_.Acknowledge(quick_id, seen->frame().number()), IsOk());
  }
  EXPECT_FALSE(slow->HasUnread()) << "its one credit is used";
  EXPECT_THAT(watches_.Acknowledge(id, slow->first().number()), IsOk());
  EXPECT_TRUE(slow->Receive()->has_form());
  // `quick` may have been shown the last frame before `slow`.
  EXPECT_GE(slow->Receive()->frame().frame().sequence(), kLast - 1);
  EXPECT_THAT(watches_.Acknowledge(id, 1'000'000),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("the last frame sent")));
  EndDrag(std::move(drag));
  slow->Cancel();
  quick->Cancel();
  slow->WaitUntilDone();
  quick->WaitUntilDone();
  const absl::Status gone = watches_.Acknowledge(id, 1);
  EXPECT_TRUE(absl::IsNotFound(gone));
  EXPECT_TRUE(HasReason(gone, ErrorReason::kWatchNotFound));
}

TEST_F(WatchTest, AWatchReportsThatItsSessionIsEvictedRestoredAndDeleted) {
  const std::string session = MakeSession();
  auto watch = Watch(session);
  watch->Begin(v1::WATCH_ORIGIN_REST);
  clock_.Advance(2 * SessionTable::kInUse);
  EXPECT_EQ(registry_.table().Evict([] { return false; }), 1) << "watching is no use";
  EXPECT_TRUE(watch->Receive()->notice().has_evicted());
  EndDrag(Drag(session));
  EXPECT_TRUE(watch->Receive()->notice().has_restored());
  registry_.sync().Delete(session.substr(session.find('/') + 1),
                          [](const absl::Status& status) { EXPECT_THAT(status, IsOk()); });
  EXPECT_FALSE(watch->Receive().has_value());
  EXPECT_EQ(watch->WaitUntilDone()->error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(watches_.size(), 0);
}

TEST_F(WatchTest, InADrainAWatchEndsWithTheLastDrag) {
  const std::string session = MakeSession();
  auto watch = Watch(session);
  watch->Begin(v1::WATCH_ORIGIN_REST);
  auto drag = Drag(session);
  const auto end = std::chrono::system_clock::time_point(std::chrono::seconds(1'800'000'000));
  watches_.NotifyDraining(end);
  EXPECT_EQ(watch->Receive()->notice().draining().end_time().seconds(), 1'800'000'000);
  Move(drag.get(), 1);
  EXPECT_TRUE(watch->Receive()->has_form());
  EXPECT_EQ(watch->Receive()->frame().frame().sequence(), 1);
  EndDrag(std::move(drag));
  EXPECT_FALSE(watch->Receive().has_value());
  EXPECT_EQ(watch->WaitUntilDone()->error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST_F(WatchTest, RefusesInvalidWatches) {
  const auto refused = [this](const std::string& session, std::optional<int> max_unacked,
                              grpc::StatusCode code, const char* text) {
    SCOPED_TRACE(text);
    auto watch = Watch(session, max_unacked);
    const auto status = watch->WaitUntilDone();
    ASSERT_TRUE(status.has_value());
    EXPECT_EQ(status->error_code(), code);
    EXPECT_THAT(status->error_message(), HasSubstr(text));
  };
  const std::string session = MakeSession();
  refused("meshes/1", {}, grpc::StatusCode::INVALID_ARGUMENT, "sessions/");
  refused("sessions/none-of-that-name", {}, grpc::StatusCode::NOT_FOUND, "none-of-that-name");
  refused(session, 0, grpc::StatusCode::INVALID_ARGUMENT, "max_unacked");
  refused(session, limits_.max_unacked + 1, grpc::StatusCode::INVALID_ARGUMENT, "max_unacked");
  std::vector<std::unique_ptr<WatchCall>> all;
  for (int i = 0; i < limits_.max_watches_per_session; ++i) {
    all.push_back(Watch(session));
    all.back()->Begin(v1::WATCH_ORIGIN_REST);
  }
  refused(session, {}, grpc::StatusCode::RESOURCE_EXHAUSTED, "--max-watches-per-session");
  for (const auto& watch : all) {
    watch->Cancel();
    watch->WaitUntilDone();
  }
  auto again = Watch(session);
  again->Begin(v1::WATCH_ORIGIN_REST);
  gate_.StartDraining();
  refused(session, {}, grpc::StatusCode::UNAVAILABLE, "draining");
  again->Cancel();
  again->WaitUntilDone();
}

TEST_F(WatchTest, WatchesSurviveWhateverHappens) {
  for (uint32_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    const std::string session = MakeSession();
    std::mt19937 random(seed);
    auto drag = Drag(session);
    std::vector<std::unique_ptr<WatchCall>> watches;
    for (uint64_t sequence = 1; sequence <= 30; ++sequence) {
      switch (random() % 8) {
        case 0:
          watches.push_back(Watch(session, 1 + static_cast<int>(random() % 3)));
          break;
        case 1:
          if (!watches.empty()) watches[random() % watches.size()]->Cancel();
          break;
        case 2:
          clock_.Advance(2 * SessionTable::kInUse);
          registry_.table().Evict([] { return false; });
          break;
        default:
          drag->Send(Pose(sequence));
          drag->Send(Ack(sequence - 1));
      }
    }
    drag->Cancel();
    drag->WaitUntilDone();
    registry_.sync().Delete(session.substr(session.find('/') + 1),
                            [](const absl::Status& /*status*/) {});
    for (const auto& watch : watches) {
      uint64_t last = 0;
      while (const auto response = watch->Receive()) {
        if (!response->has_frame()) continue;
        EXPECT_GT(response->frame().number(), last);
        last = response->frame().number();
      }
      EXPECT_TRUE(watch->WaitUntilDone().has_value()) << "the watch does not end";
    }
    EXPECT_EQ(watches_.size(), 0);
  }
}

}  // namespace
}  // namespace tissueform::testing
