// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/reattachment.h"

#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

absl::Status MovedToNobody() {
  return WithReason(absl::UnavailableError("moved"), ErrorReason::kSessionMoved);
}

// Whose first wait is longer than its patience: it comes back at once, or not at all.
Reattachment::Options AtOnceOrNever(std::chrono::milliseconds lasting) {
  return {.backoff = {.first = std::chrono::hours(1), .most = std::chrono::hours(1)},
          .lasting = lasting,
          .give_up_after = kLongestMovingWait / 4};
}

class ReattachmentTest : public ::testing::Test {
 protected:
  // One more stream, which begins and is lost.
  absl::Status Lose(Reattachment* reattachment, const absl::Status& why) {
    return reattachment->After(why, [this] {
      ++opened_;
      return absl::OkStatus();
    });
  }

  int opened_ = 0;
};

TEST_F(ReattachmentTest, AfterAMoveTheNextStreamIsOpenedAtOnce) {
  Reattachment reattachment(AtOnceOrNever(std::chrono::hours(1)));
  EXPECT_THAT(Lose(&reattachment, MovedToNobody()), IsOk());
  EXPECT_EQ(reattachment.count(), 1);
}

TEST_F(ReattachmentTest, StreamsThatComeToNothingAreNotOpenedWithoutPause) {
  Reattachment reattachment(AtOnceOrNever(std::chrono::hours(1)));
  EXPECT_THAT(Lose(&reattachment, MovedToNobody()), IsOk());
  EXPECT_TRUE(absl::IsUnavailable(Lose(&reattachment, MovedToNobody())));
  EXPECT_EQ(opened_, 1);
}

TEST_F(ReattachmentTest, AfterAStreamThatLastedItIsAtOnceAgain) {
  Reattachment reattachment(AtOnceOrNever(std::chrono::milliseconds(0)));
  for (int i = 0; i < 3; ++i) EXPECT_THAT(Lose(&reattachment, MovedToNobody()), IsOk());
  EXPECT_EQ(opened_, 3);
}

TEST_F(ReattachmentTest, WaitsGrowOverStreamsThatComeToNothing) {
  const std::chrono::milliseconds patience(100);
  Reattachment reattachment({.backoff = {.first = std::chrono::milliseconds(1), .factor = 4},
                             .lasting = std::chrono::hours(1),
                             .give_up_after = patience});
  const absl::Status lost = absl::UnavailableError("lost");
  // 1, 4, 16, 64 and 256 ms, a fifth more or less.
  while (Lose(&reattachment, lost).ok()) ASSERT_LT(opened_, 5);
  EXPECT_GE(opened_, 3);
}

}  // namespace
}  // namespace tissueform::testing
