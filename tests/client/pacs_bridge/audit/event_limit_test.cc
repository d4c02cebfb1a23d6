// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/event_limit.h"

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using std::chrono::seconds;

constexpr EventLimit::Time kStart = EventLimit::Time(seconds(1000));

int Admitted(EventLimit* limit, const std::string& source, EventLimit::Time now, int events) {
  int admitted = 0;
  for (int i = 0; i < events; ++i) admitted += limit->Admit(source, now) ? 1 : 0;
  return admitted;
}

TEST(EventLimitTest, EachSourceHasItsOwnLimit) {
  EventLimit limit({.max_per_source = 3});
  EXPECT_EQ(Admitted(&limit, "a", kStart, 10), 3);
  EXPECT_EQ(Admitted(&limit, "b", kStart, 2), 2);
  EXPECT_EQ(limit.dropped(), 7);
}

TEST(EventLimitTest, APeriodBeginsWithTheFirstEventAfterTheLast) {
  EventLimit limit({.max_per_source = 1});
  EXPECT_EQ(Admitted(&limit, "a", kStart, 2), 1);
  EXPECT_EQ(limit.period_end(), kStart + seconds(60));
  EXPECT_EQ(Admitted(&limit, "a", kStart + seconds(59), 1), 0);
  EXPECT_EQ(Admitted(&limit, "a", kStart + seconds(75), 2), 1);
  EXPECT_EQ(limit.period_end(), kStart + seconds(135));
}

TEST(EventLimitTest, ReportsTheDroppedCountOnce) {
  EventLimit limit({.max_per_source = 1});
  Admitted(&limit, "a", kStart, 5);
  EXPECT_EQ(limit.TakeDropped(), 4);
  EXPECT_EQ(limit.TakeDropped(), 0);
}

TEST(EventLimitTest, MoreSourcesThanItHoldsAreDropped) {
  EventLimit limit({.max_per_source = 5, .max_sources = 100});
  int admitted = 0;
  for (int i = 0; i < 1000; ++i) admitted += limit.Admit(absl::StrCat(i), kStart) ? 1 : 0;
  EXPECT_EQ(admitted, 100);
  EXPECT_EQ(limit.dropped(), 900);
  EXPECT_TRUE(limit.Admit("7", kStart)) << "known sources keep their limit";
}

}  // namespace
}  // namespace tissueform
