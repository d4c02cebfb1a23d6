// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_drag.h"

#include <chrono>
#include <future>
#include <memory>
#include <optional>
#include <utility>

#include "gtest/gtest.h"

#include "tests/server/rpc/stream_parts_fixture.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::tissueform::testing::BarRecord;
using ::tissueform::testing::StatusIs;
using Answer = absl::StatusOr<std::optional<AnswerFrame>>;
using EarlyAnswer = FrameScheduler::EarlyAnswer;

WaitingPose PoseAt(uint64_t sequence, double z) {
  HandlePose pose;
  pose.translation_mm.z() = z;
  return {.sequence = sequence, .poses = {pose}};
}

// A stream of one pose.
class FakeHost final : public DragHost {
 public:
  struct Finished {
    std::optional<WaitingPose> pose;
    Answer answer;
  };

  std::optional<WaitingPose> TakeNewest() override { return std::exchange(newest, std::nullopt); }
  std::optional<WaitingPose> TakeEstimated() override {
    return std::exchange(estimated, std::nullopt);
  }
  EarlyAnswer JudgeEarly() override { return early; }
  void OfferEarly(AnswerFrame /*frame*/) override { ++num_early; }
  void FinishAnswer(const Session& /*session*/, std::optional<WaitingPose> pose,
                    Answer answer) override {
    finished.set_value({std::move(pose), std::move(answer)});
  }
  Finished Wait() { return finished.get_future().get(); }

  std::optional<WaitingPose> newest;
  std::optional<WaitingPose> estimated;
  EarlyAnswer early = EarlyAnswer::kShow;
  int num_early = 0;
  std::promise<Finished> finished;
};

class StreamDragTest : public testing::StreamPartsTest {
 protected:
  std::shared_ptr<const StreamConfiguration> Configure(
      std::shared_ptr<Session> session, const v1::DeformConfiguration& request = Request()) {
    auto configuration =
        ReadConfiguration(*ReadStreamRequest(request, limits_), std::move(session));
    EXPECT_TRUE(configuration.ok()) << configuration.status();
    return *configuration;
  }

  // Of a model that shows early answers.
  std::shared_ptr<const StreamConfiguration> Iterating() {
    SessionRecord record = BarRecord(*bar_);
    record.model = DeformationModel::kNeoHookean;
    return Configure(MakeSession(record));
  }

  FakeHost host_;
};

TEST_F(StreamDragTest, AnswersTheNewestPoseByASolve) {
  host_.newest = PoseAt(3, 0.1);
  PostAnswer(&host_, Configure(MakeSession()), nullptr);
  const FakeHost::Finished finished = host_.Wait();
  ASSERT_TRUE(finished.answer.ok() && finished.answer->has_value()) << finished.answer.status();
  EXPECT_EQ((*finished.answer)->sequence, 3);
  EXPECT_FALSE((*finished.answer)->summary.prepared);
  EXPECT_EQ(finished.pose->sequence, 3);
}

TEST_F(StreamDragTest, AnswersFromPreparedColumnsAndSolvesUncoveredPoses) {
  v1::DeformConfiguration request = Request();
  request.mutable_prepared()->set_tolerance_mm(1e-3);
  const auto configuration = Configure(MakeSession(), request);
  ASSERT_OK_AND_ASSIGN(const StreamBegin begin, PrepareAnswers(*configuration, {}));
  HandlePose far_away;
  far_away.translation_mm.z() = 0.1;
  far_away.rotation_vector = {2, 0, 0};
  for (const bool covered : {true, false}) {
    FakeHost host;
    host.newest = covered ? PoseAt(1, 0.1) : WaitingPose{.sequence = 1, .poses = {far_away}};
    PostAnswer(&host, configuration, begin.claim);
    const FakeHost::Finished finished = host.Wait();
    ASSERT_TRUE(finished.answer.ok() && finished.answer->has_value()) << finished.answer.status();
    EXPECT_EQ((*finished.answer)->summary.prepared, covered);
    EXPECT_EQ(finished.pose->sequence, 1);
  }
}

TEST_F(StreamDragTest, EndsWithoutAnAnswerWhereNothingIsToBeAnswered) {
  const auto configuration = Configure(MakeSession());
  PostAnswer(&host_, configuration, nullptr);
  const FakeHost::Finished finished = host_.Wait();
  ASSERT_TRUE(finished.answer.ok());
  EXPECT_FALSE(finished.answer->has_value());
  EXPECT_FALSE(finished.pose.has_value());
}

TEST_F(StreamDragTest, GivesThePoseBackWhenTheSessionHasLeftMemory) {
  const auto configuration = Configure(MakeSession());
  configuration->session->Close(Session::CloseReason::kEvicted);
  host_.newest = PoseAt(5, 0.1);
  PostAnswer(&host_, configuration, nullptr);
  const FakeHost::Finished finished = host_.Wait();
  EXPECT_THAT(finished.answer, StatusIs(absl::StatusCode::kNotFound));
  EXPECT_EQ(finished.pose->sequence, 5);
}

TEST_F(StreamDragTest, ShowsIntermediateIterationsAndStopsForANewerPose) {
  host_.newest = PoseAt(1, 0.2);
  PostAnswer(&host_, Iterating(), nullptr);
  FakeHost::Finished finished = host_.Wait();
  ASSERT_TRUE(finished.answer.ok()) << finished.answer.status();
  EXPECT_FALSE((*finished.answer)->summary.cancelled);
  EXPECT_GT(host_.num_early, 0);

  FakeHost hurried;
  hurried.early = EarlyAnswer::kStop;
  hurried.newest = PoseAt(2, 0.2);
  PostAnswer(&hurried, Iterating(), nullptr);
  finished = hurried.Wait();
  ASSERT_TRUE(finished.answer.ok()) << finished.answer.status();
  EXPECT_TRUE((*finished.answer)->summary.cancelled);
  EXPECT_EQ(hurried.num_early, 0);
}

TEST_F(StreamDragTest, ARefinementShowsNothingBeforeItsEnd) {
  host_.estimated = PoseAt(4, 0.2);
  PostRefinement(&host_, Iterating());
  const FakeHost::Finished finished = host_.Wait();
  ASSERT_TRUE(finished.answer.ok() && finished.answer->has_value()) << finished.answer.status();
  EXPECT_EQ((*finished.answer)->sequence, 4);
  EXPECT_EQ(host_.num_early, 0);
}

// The timer calls nothing within the test.
TEST(DragRestTest, IsOverWhenNoNewerEstimateCame) {
  DeadlineTimer timer;
  DragRest rest(&timer, [] { ADD_FAILURE(); });
  const DragRest::TimePoint now = std::chrono::steady_clock::now() + std::chrono::hours(1);
  const DragRest::TimePoint later = now + DragRest::kRest / 2;
  rest.Begin(now);
  EXPECT_NE(rest.wait(), DeadlineTimer::Id());
  timer.Cancel(rest.wait());
  EXPECT_FALSE(rest.IsOver(later));
  rest.Begin(later);
  EXPECT_FALSE(rest.EndWait(now + DragRest::kRest, /*is_needed=*/true));
  EXPECT_NE(rest.wait(), DeadlineTimer::Id());
  timer.Cancel(rest.wait());
  EXPECT_TRUE(rest.EndWait(later + DragRest::kRest, /*is_needed=*/true));
  EXPECT_EQ(rest.wait(), DeadlineTimer::Id());
}

TEST(DragRestTest, WaitsNoLongerWithoutAnEstimate) {
  DeadlineTimer timer;
  DragRest rest(&timer, [] { ADD_FAILURE(); });
  const DragRest::TimePoint now = std::chrono::steady_clock::now() + std::chrono::hours(1);
  rest.Begin(now);
  timer.Cancel(rest.wait());
  EXPECT_FALSE(rest.EndWait(now, /*is_needed=*/false));
  EXPECT_EQ(rest.wait(), DeadlineTimer::Id());
}

}  // namespace
}  // namespace tissueform
