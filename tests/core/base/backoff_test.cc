// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/backoff.h"

#include "gtest/gtest.h"

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

using std::chrono::milliseconds;

const absl::Status kLost = absl::UnavailableError("lost");

// Without chance.
Backoff::Options Exact() { return {.spread = 0}; }

TEST(BackoffTest, WaitsGrowUpToTheLongest) {
  Backoff backoff(Exact());
  milliseconds before(0);
  for (int i = 0; i < 20; ++i) {
    const milliseconds wait = backoff.Next();
    EXPECT_GE(wait, before);
    before = wait;
  }
  EXPECT_EQ(before, Exact().most);
  backoff.Reset();
  EXPECT_EQ(backoff.Next(), Exact().first);
}

TEST(BackoffTest, ASessionThatMovesIsAskedForAFewTimesASecond) {
  for (const ErrorReason reason : {ErrorReason::kSessionMoved, ErrorReason::kWrongNode}) {
    Backoff backoff(Exact());
    const absl::Status moving = WithReason(kLost, reason);
    milliseconds all(0);
    int attempts = 0;
    for (; all < milliseconds(40'000); ++attempts) {
      const milliseconds wait = backoff.After(moving);
      EXPECT_LE(wait, kLongestMovingWait);
      all += wait;
    }
    EXPECT_LT(attempts, 40 * 3);
    EXPECT_LE(backoff.After(kLost), 2 * kLongestMovingWait) << "the move took long";
  }
}

TEST(BackoffTest, WaitsLongerAfterALossThanForAMove) {
  Backoff backoff(Exact());
  for (int i = 0; i < 20; ++i) backoff.After(kLost);
  EXPECT_EQ(backoff.After(kLost), Exact().most);
  EXPECT_EQ(backoff.After(WithReason(kLost, ErrorReason::kSessionMoved)), kLongestMovingWait);
}

TEST(BackoffTest, ClientsDoNotComeBackAllAtOnce) {
  Backoff one({});
  Backoff other({});
  bool differs = false;
  for (int i = 0; i < 10; ++i) differs = differs || one.Next() != other.Next();
  EXPECT_TRUE(differs);
}

}  // namespace
}  // namespace tissueform
