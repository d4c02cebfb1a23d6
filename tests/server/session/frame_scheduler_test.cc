// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/frame_scheduler.h"

#include <numeric>
#include <optional>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;
using EarlyAnswer = FrameScheduler::EarlyAnswer;

using ::tissueform::testing::kInvalid;

AnswerFrame Answer(const WaitingPose& pose) {
  return {.sequence = pose.sequence,
          .coalesced_count = pose.coalesced_count,
          .summary = {},
          .positions = {}};
}

// Solves what waits, and takes the frame. REQUIRES: StartSolve is true.
AnswerFrame SolveAndTake(FrameScheduler* flow) {
  EXPECT_TRUE(flow->StartSolve());
  const std::optional<WaitingPose> pose = flow->TakePose();
  flow->FinishSolve(Answer(*pose));
  return *flow->TakeFrame();
}

TEST(FrameSchedulerTest, TheNewestPoseWinsAndCountsThoseItReplaced) {
  FrameScheduler flow(2);
  EXPECT_FALSE(flow.StartSolve()) << "nothing waits";
  for (uint64_t sequence = 1; sequence <= 5; ++sequence) {
    ASSERT_THAT(flow.Put(sequence, {}), IsOk());
  }
  const AnswerFrame frame = SolveAndTake(&flow);
  EXPECT_EQ(frame.sequence, 5);
  EXPECT_EQ(frame.coalesced_count, 4);
  EXPECT_EQ(frame.refinement, 0);
  EXPECT_FALSE(frame.refining);
  ASSERT_THAT(flow.Put(6, {}), IsOk());
  EXPECT_EQ(SolveAndTake(&flow).coalesced_count, 0) << "each pose is counted once";
}

TEST(FrameSchedulerTest, APoseThatComesBeforeTheJobRunsIsTheOneThatIsSolved) {
  FrameScheduler flow(2);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_TRUE(flow.StartSolve());
  ASSERT_THAT(flow.Put(2, {}), IsOk());
  const std::optional<WaitingPose> pose = flow.TakePose();
  EXPECT_EQ(pose->sequence, 2);
  EXPECT_EQ(pose->coalesced_count, 1);
}

TEST(FrameSchedulerTest, OneSolveAtATimeAndNoneWhileAFrameWaits) {
  FrameScheduler flow(8);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_TRUE(flow.StartSolve());
  const std::optional<WaitingPose> pose = flow.TakePose();
  ASSERT_THAT(flow.Put(2, {}), IsOk());
  EXPECT_FALSE(flow.StartSolve()) << "one is under way";
  flow.FinishSolve(Answer(*pose));
  EXPECT_FALSE(flow.StartSolve()) << "its frame waits";
  EXPECT_TRUE(flow.TakeFrame().has_value());
  EXPECT_TRUE(flow.StartSolve());
}

TEST(FrameSchedulerTest, NothingIsSolvedWhileSomethingIsPrepared) {
  FrameScheduler flow(2);
  flow.StartPreparation();
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  EXPECT_TRUE(flow.busy());
  EXPECT_FALSE(flow.StartSolve());
  flow.FinishPreparation();
  EXPECT_TRUE(flow.StartSolve());
}

TEST(FrameSchedulerTest, WithoutCreditNothingIsSolved) {
  for (const size_t max_unacked : {1UL, 2UL, 5UL}) {
    FrameScheduler flow(max_unacked);
    uint64_t sequence = 0;
    for (size_t i = 0; i < max_unacked; ++i) {
      ASSERT_THAT(flow.Put(++sequence, {}), IsOk());
      SolveAndTake(&flow);
    }
    ASSERT_THAT(flow.Put(++sequence, {}), IsOk());
    EXPECT_FALSE(flow.StartSolve());
    ASSERT_THAT(flow.Acknowledge(1, 0), IsOk());
    EXPECT_EQ(SolveAndTake(&flow).sequence, sequence);
  }
}

TEST(FrameSchedulerTest, AnAcknowledgementCoversAllFramesBeforeIt) {
  FrameScheduler flow(3);
  for (uint64_t sequence = 1; sequence <= 3; ++sequence) {
    ASSERT_THAT(flow.Put(sequence, {}), IsOk());
    SolveAndTake(&flow);
  }
  ASSERT_THAT(flow.Acknowledge(3, std::nullopt), IsOk());
  for (uint64_t sequence = 4; sequence <= 6; ++sequence) {
    ASSERT_THAT(flow.Put(sequence, {}), IsOk());
    SolveAndTake(&flow);
  }
}

TEST(FrameSchedulerTest, FramesThatWereNotMadeCannotBeAcknowledged) {
  FrameScheduler flow(2);
  EXPECT_THAT(flow.Acknowledge(1, std::nullopt), StatusIs(kInvalid, HasSubstr("not sent")));
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  SolveAndTake(&flow);
  EXPECT_THAT(flow.Acknowledge(1, 1), StatusIs(kInvalid, HasSubstr("refinement 1")));
  EXPECT_THAT(flow.Acknowledge(2, std::nullopt), StatusIs(kInvalid, HasSubstr("frame 2")));
  EXPECT_THAT(flow.Acknowledge(1, 0), IsOk());
  EXPECT_THAT(flow.Acknowledge(1, 0), IsOk()) << "twice does no harm";
}

// Answers what waits by an estimate, and takes its frame. REQUIRES: StartSolve is true.
AnswerFrame EstimateAndTake(FrameScheduler* flow) {
  EXPECT_TRUE(flow->StartSolve());
  const std::optional<WaitingPose> pose = flow->TakePose();
  flow->FinishEstimate(Answer(*pose), *pose);
  return *flow->TakeFrame();
}

TEST(FrameSchedulerTest, RefinesAnEstimateWhenTheDragRests) {
  FrameScheduler flow(2);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  EXPECT_FALSE(flow.StartRefinement(true)) << "there is no estimate";
  const AnswerFrame estimate = EstimateAndTake(&flow);
  EXPECT_TRUE(estimate.refining);
  EXPECT_FALSE(flow.StartRefinement(false));
  ASSERT_TRUE(flow.StartRefinement(true));
  EXPECT_TRUE(flow.busy());
  const std::optional<WaitingPose> pose = flow.TakeRefinement();
  ASSERT_TRUE(pose.has_value());
  EXPECT_EQ(pose->sequence, 1);
  flow.FinishSolve(Answer(*pose));
  const AnswerFrame worked_out = *flow.TakeFrame();
  EXPECT_EQ(worked_out.sequence, 1);
  EXPECT_EQ(worked_out.refinement, 1);
  EXPECT_FALSE(worked_out.refining);
  EXPECT_FALSE(flow.StartRefinement(true)) << "once";
}

TEST(FrameSchedulerTest, ANewerPoseTakesThePlaceOfAnEstimatesWork) {
  FrameScheduler flow(3);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  EstimateAndTake(&flow);
  ASSERT_THAT(flow.Put(2, {}), IsOk());
  EXPECT_FALSE(flow.StartRefinement(true));
  // One that comes while the estimate is made.
  ASSERT_TRUE(flow.StartSolve());
  const std::optional<WaitingPose> pose = flow.TakePose();
  ASSERT_THAT(flow.Put(3, {}), IsOk());
  flow.FinishEstimate(Answer(*pose), *pose);
  EXPECT_FALSE(flow.has_estimate());
  flow.TakeFrame();
  EXPECT_EQ(EstimateAndTake(&flow).sequence, 3);
}

TEST(FrameSchedulerTest, WithoutCreditAnEstimateWaitsAndAClosedDragStillWorksItOut) {
  FrameScheduler flow(1);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  EstimateAndTake(&flow);
  EXPECT_FALSE(flow.StartRefinement(true)) << "its frame is not acknowledged";
  flow.CloseSending();
  EXPECT_FALSE(flow.Done());
  ASSERT_TRUE(flow.StartRefinement(false)) << "nobody's hand is at work";
  flow.FinishSolve(Answer(*flow.TakeRefinement()));
  EXPECT_FALSE(flow.Done());
  EXPECT_FALSE(flow.TakeFrame()->refining);
  EXPECT_TRUE(flow.Done());
}

TEST(FrameSchedulerTest, SequencesMustRise) {
  FrameScheduler flow(2);
  ASSERT_THAT(flow.Put(0, {}), IsOk());
  EXPECT_THAT(flow.Put(0, {}), StatusIs(kInvalid, HasSubstr("sequence 0 after 0")));
  ASSERT_THAT(flow.Put(7, {}), IsOk());
  EXPECT_THAT(flow.Put(6, {}), StatusIs(kInvalid, HasSubstr("sequence 6 after 7")));
  EXPECT_EQ(SolveAndTake(&flow).sequence, 7) << "what waited still does";
}

TEST(FrameSchedulerTest, EarlyAnswersKeepOneCreditForTheLast) {
  FrameScheduler flow(3);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_THAT(flow.Put(2, {}), IsOk());
  ASSERT_TRUE(flow.StartSolve());
  const std::optional<WaitingPose> pose = flow.TakePose();
  for (int refinement = 0; refinement < 2; ++refinement) {
    ASSERT_EQ(flow.JudgeEarly(), EarlyAnswer::kShow);
    flow.OfferEarly(Answer(*pose));
    const std::optional<AnswerFrame> frame = flow.TakeFrame();
    ASSERT_TRUE(frame.has_value());
    EXPECT_TRUE(frame->refining);
    EXPECT_EQ(frame->refinement, refinement);
    EXPECT_EQ(frame->coalesced_count, refinement == 0 ? 1 : 0) << "told once a pose";
  }
  EXPECT_EQ(flow.JudgeEarly(), EarlyAnswer::kSkip);
  flow.FinishSolve(Answer(*pose));
  const std::optional<AnswerFrame> last = flow.TakeFrame();
  EXPECT_FALSE(last->refining);
  EXPECT_EQ(last->refinement, 2);
  ASSERT_THAT(flow.Put(3, {}), IsOk());
  EXPECT_FALSE(flow.StartSolve()) << "all three are on their way";
  ASSERT_THAT(flow.Acknowledge(2, 0), IsOk());
  EXPECT_TRUE(flow.StartSolve());
}

TEST(FrameSchedulerTest, WithOneCreditNothingIsShownEarly) {
  FrameScheduler flow(1);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_TRUE(flow.StartSolve());
  EXPECT_TRUE(flow.TakePose().has_value());
  EXPECT_EQ(flow.JudgeEarly(), EarlyAnswer::kSkip);
}

TEST(FrameSchedulerTest, ABetterAnswerReplacesTheOneThatStillWaitsForItsWrite) {
  FrameScheduler flow(4);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_THAT(flow.Put(2, {}), IsOk());
  ASSERT_TRUE(flow.StartSolve());
  const std::optional<WaitingPose> pose = flow.TakePose();
  flow.OfferEarly(Answer(*pose));
  EXPECT_EQ(flow.JudgeEarly(), EarlyAnswer::kSkip) << "a frame waits";
  flow.FinishSolve(Answer(*pose));
  const std::optional<AnswerFrame> frame = flow.TakeFrame();
  EXPECT_FALSE(frame->refining);
  EXPECT_EQ(frame->refinement, 0) << "the first that is sent";
  EXPECT_EQ(frame->coalesced_count, 1);
  EXPECT_FALSE(flow.TakeFrame().has_value());
}

TEST(FrameSchedulerTest, ANewerPoseStopsASolveWhoseFirstFrameIsKept) {
  FrameScheduler flow(3);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_TRUE(flow.StartSolve());
  WaitingPose pose = *flow.TakePose();
  ASSERT_THAT(flow.Put(2, {}), IsOk());
  EXPECT_EQ(flow.JudgeEarly(), EarlyAnswer::kStop);
  AnswerFrame given_up = Answer(pose);
  given_up.summary.cancelled = true;
  flow.FinishSolve(given_up);
  EXPECT_EQ(flow.TakeFrame()->sequence, 1) << "better than no frame of that pose";

  ASSERT_TRUE(flow.StartSolve());
  pose = *flow.TakePose();
  flow.OfferEarly(Answer(pose));
  EXPECT_TRUE(flow.TakeFrame().has_value());
  given_up = Answer(pose);
  given_up.summary.cancelled = true;
  flow.FinishSolve(given_up);
  EXPECT_FALSE(flow.TakeFrame().has_value()) << "its pose has a frame already";
}

TEST(FrameSchedulerTest, AfterCloseTheNewestPoseIsAnsweredWithoutCredit) {
  FrameScheduler flow(1);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  SolveAndTake(&flow);
  ASSERT_THAT(flow.Put(2, {}), IsOk());
  EXPECT_FALSE(flow.StartSolve());
  flow.CloseSending();
  EXPECT_FALSE(flow.Done());
  EXPECT_EQ(SolveAndTake(&flow).sequence, 2);
  EXPECT_TRUE(flow.Done());
}

TEST(FrameSchedulerTest, ClosingWhileASolveRunsWaitsForItsFrame) {
  FrameScheduler flow(2);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_TRUE(flow.StartSolve());
  const std::optional<WaitingPose> pose = flow.TakePose();
  flow.CloseSending();
  EXPECT_FALSE(flow.Done()) << "it solves";
  flow.FinishSolve(Answer(*pose));
  EXPECT_FALSE(flow.Done()) << "its frame waits";
  EXPECT_TRUE(flow.TakeFrame().has_value());
  EXPECT_TRUE(flow.Done());
}

TEST(FrameSchedulerTest, MeasuresPosesFramesAndAcknowledgements) {
  FrameMeasures measures;
  FrameScheduler flow(2, &measures);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_THAT(flow.Put(2, {}), IsOk());
  EXPECT_EQ(SolveAndTake(&flow).sequence, 2);
  ASSERT_THAT(flow.Put(3, {}), IsOk());
  EXPECT_EQ(SolveAndTake(&flow).sequence, 3);
  EXPECT_EQ(measures.poses, 3);
  EXPECT_EQ(measures.coalesced_poses, 1);
  EXPECT_EQ(measures.frames, 2);
  const auto count = [](const DurationHistogram& histogram) {
    const auto counts = histogram.Read().counts;
    return std::accumulate(counts.begin(), counts.end(), uint64_t{0});
  };
  EXPECT_EQ(count(measures.latency), 2);
  EXPECT_EQ(count(measures.picture_age), 0);
  ASSERT_THAT(flow.Acknowledge(3, std::nullopt), IsOk());
  EXPECT_EQ(count(measures.picture_age), 1) << "the frame that is looked at, not those before it";
}

TEST(FrameSchedulerTest, SolveWithoutAnswerFreesTheScheduler) {
  FrameScheduler flow(1);
  ASSERT_THAT(flow.Put(1, {}), IsOk());
  ASSERT_TRUE(flow.StartSolve());
  EXPECT_TRUE(flow.TakePose().has_value());
  flow.FinishSolve(std::nullopt);
  EXPECT_FALSE(flow.busy());
  EXPECT_FALSE(flow.TakeFrame().has_value());
}

}  // namespace
}  // namespace tissueform
