// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_opening.h"

#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "tests/server/rpc/stream_parts_fixture.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::tissueform::testing::BarRecord;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

class StreamOpeningTest : public testing::StreamPartsTest {
 protected:
  StreamOpening opening_;
};

TEST_F(StreamOpeningTest, BeginsWithItsSessionAndSendsNoNotice) {
  ASSERT_THAT(opening_.TakeRequest(Request(), limits_), IsOk());
  EXPECT_EQ(opening_.request().session_id, "id");
  EXPECT_EQ(opening_.configuration(), nullptr);
  const auto session = MakeSession();
  ASSERT_THAT(opening_.TakeSession(session), IsOk());
  EXPECT_EQ(opening_.configuration()->session, session);
  EXPECT_FALSE(opening_.Resume().has_value());
}

TEST_F(StreamOpeningTest, RefusesARequestThatIsOutOfRange) {
  v1::DeformConfiguration request = Request();
  request.set_max_unacked(0);
  EXPECT_THAT(opening_.TakeRequest(request, limits_), StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST_F(StreamOpeningTest, ReportsThatTheSessionWasEvictedAndRestored) {
  ASSERT_THAT(opening_.TakeRequest(Request(), limits_), IsOk());
  ASSERT_THAT(opening_.TakeSession(MakeSession()), IsOk());
  EXPECT_TRUE(opening_.Leave()->has_evicted());
  const auto again = MakeSession();
  ASSERT_THAT(opening_.TakeSession(again), IsOk());
  EXPECT_EQ(opening_.configuration()->session, again);
  EXPECT_TRUE(opening_.Resume()->has_restored());
  EXPECT_FALSE(opening_.Resume().has_value());
}

TEST_F(StreamOpeningTest, ReportsAnUpdateOnlyWhenTheNewSessionIsThere) {
  ASSERT_THAT(opening_.TakeRequest(Request(), limits_), IsOk());
  ASSERT_THAT(opening_.TakeSession(MakeSession()), IsOk());
  opening_.configuration()->session->MarkUpdated(/*other_handles=*/false);
  EXPECT_FALSE(opening_.Leave().has_value());
  ASSERT_THAT(opening_.TakeSession(MakeSession()), IsOk());
  EXPECT_TRUE(opening_.Resume()->has_updated());
}

TEST_F(StreamOpeningTest, AnEvictedSessionThatComesBackUpdatedIsUpdated) {
  ASSERT_THAT(opening_.TakeRequest(Request(), limits_), IsOk());
  ASSERT_THAT(opening_.TakeSession(MakeSession()), IsOk());
  EXPECT_TRUE(opening_.Leave()->has_evicted());
  opening_.configuration()->session->MarkUpdated(/*other_handles=*/false);
  ASSERT_THAT(opening_.TakeSession(MakeSession()), IsOk());
  EXPECT_TRUE(opening_.Resume()->has_updated());
}

TEST_F(StreamOpeningTest, DoesNotGoOnWithOtherHandles) {
  ASSERT_THAT(opening_.TakeRequest(Request(), limits_), IsOk());
  const auto before = MakeSession();
  ASSERT_THAT(opening_.TakeSession(before), IsOk());
  SessionRecord record = BarRecord(*bar_);
  record.handles[0].name = "other";
  const absl::Status refused = opening_.TakeSession(MakeSession(record));
  EXPECT_THAT(refused, StatusIs(absl::StatusCode::kAborted));
  EXPECT_TRUE(HasReason(refused, ErrorReason::kSessionUpdated));
  EXPECT_EQ(opening_.configuration()->session, before);
}

}  // namespace
}  // namespace tissueform
