// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/queue/draft_rows.h"
#include "client/pacs_bridge/review/review_page.h"
#include "client/pacs_bridge/review/review_queue.h"
#include "client/pacs_bridge/work/plan_work.h"
#include "tests/client/pacs_bridge/work/bridge_work.h"

// What becomes of a draft that was sent; integration_drafts sends them.
namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

class DraftWorkTest : public BridgeWork {
 protected:
  DraftWorkTest() {
    SeriesRule rule = SmallRule();
    rule.draft = true;
    UseRule(rule);
  }

  // A received series whose draft waits on the server.
  QueuedSeries WaitingDraft() {
    received_ = Receive("ct");
    WaitQuietly();
    Settle();
    EXPECT_EQ(StateOf(received_), SeriesState::kDrafting);
    QueuedSeries series = *rows_.GetByUid(received_.series_uid);
    EXPECT_THAT(server_->SendDraft("ct", TitleOfSeries(series.key), "{}"), IsOk());
    EXPECT_THAT(
        drafts_.Add({.name = NewestDraft().name(), .series = series.key, .images = series.images}),
        IsOk());
    series.state = SeriesState::kDraft;
    EXPECT_THAT(rows_.UpdateStep(series, SeriesState::kDrafting), IsOk());
    return series;
  }
  v1::BuildDraft& NewestDraft() { return server_->drafts.back(); }
  QueuedSeries Now() { return *rows_.GetByUid(received_.series_uid); }

  CtSeries received_;
  DraftRows drafts_{queue_.get()};
  PlanWork plans_{queue_.get(), server_.get(), {}};
};

TEST_F(DraftWorkTest, EachCaseOfADraftIsOneOfItsSeries) {
  const QueuedSeries series = WaitingDraft();
  EXPECT_THAT(*plans_.FollowDrafts(), IsEmpty());
  EXPECT_EQ(Now().done_s, 0) << "its images stay while it waits";
  NewestDraft().add_cases("cases/1");
  EXPECT_THAT(*plans_.FollowDrafts(), ElementsAre(series.key));
  EXPECT_EQ(Now().state, SeriesState::kPublished);
  EXPECT_GT(Now().done_s, 0);
  EXPECT_THAT(*plans_.FollowDrafts(), IsEmpty());
  NewestDraft().add_cases("cases/2");
  EXPECT_THAT(*plans_.FollowDrafts(), ElementsAre(series.key));
  EXPECT_EQ(Now().case_name, "cases/2");
  for (const char* name : {"cases/1", "cases/2"}) {
    EXPECT_EQ(rows_.GetByCase(name)->key, series.key) << name;
    EXPECT_THAT(*rows_.ListSources(name), SizeIs(series.images)) << name;
  }
  // The server no longer reports it: its cases stay those of the series.
  server_->drafts.clear();
  EXPECT_THAT(*plans_.FollowDrafts(), IsEmpty());
  EXPECT_EQ(Now().state, SeriesState::kPublished);
  EXPECT_THAT(*drafts_.List(), IsEmpty());
}

TEST_F(DraftWorkTest, LateImagesAreNotPartOfTheDraft) {
  const QueuedSeries series = WaitingDraft();
  const int64_t images = series.images;
  Receive("more",
          {.study_uid = series.study_uid, .series_uid = series.uid, .frame_uid = series.frame_uid});
  Settle();
  EXPECT_EQ(Now().state, SeriesState::kDraft);
  EXPECT_EQ(Now().images, 2 * images);
  NewestDraft().add_cases("cases/1");
  ASSERT_THAT(plans_.FollowDrafts(), IsOk());
  EXPECT_THAT(*rows_.ListSources("cases/1"), SizeIs(images));
}

TEST_F(DraftWorkTest, ReportsALostDraft) {
  const QueuedSeries series = WaitingDraft();
  server_->away = absl::UnavailableError("the server is away");
  EXPECT_THAT(plans_.FollowDrafts(), StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_EQ(Now().state, SeriesState::kDraft) << "a server that is away has not lost it";
  server_->away = absl::OkStatus();
  server_->drafts.clear();
  EXPECT_THAT(*plans_.FollowDrafts(), ElementsAre(series.key));
  EXPECT_EQ(Now().state, SeriesState::kFailed);
  EXPECT_THAT(Now().last_error, HasSubstr("tissueform-pacs draft"));
}

TEST_F(DraftWorkTest, CaseOfADraftDoesNotReplaceAPlanBuiltOtherwise) {
  WaitingDraft();
  MakeCase(received_);
  const std::string built = Now().case_name;
  NewestDraft().add_cases("cases/1");
  EXPECT_THAT(*plans_.FollowDrafts(), IsEmpty());
  EXPECT_EQ(Now().case_name, built);
  EXPECT_THAT(rows_.GetByCase("cases/1"), IsOk()) << "predictions of it can be stored";
}

TEST_F(DraftWorkTest, AnExportOfANewCaseIsTakenBeforeTheCaseWasFollowed) {
  WaitingDraft();
  v1::Export requested;
  requested.set_name("exports/1");
  requested.set_prediction("predictions/1");
  requested.set_case_("cases/1");
  requested.set_state(v1::EXPORT_STATE_WAITING);
  ASSERT_THAT(work_->Take(requested), IsOk());
  EXPECT_THAT(exports_.Get("exports/1"), StatusIs(absl::StatusCode::kNotFound)) << "of another";
  NewestDraft().add_cases("cases/1");
  ASSERT_THAT(work_->Take(requested), IsOk());
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  // The page of who confirms shows it, also when another case of the draft is newer.
  NewestDraft().add_cases("cases/2");
  ASSERT_THAT(plans_.FollowDrafts(), IsOk());
  ASSERT_OK_AND_ASSIGN(const ReviewQueue list, ReadReviewQueue(queue_.get()));
  ASSERT_THAT(list.exports, SizeIs(1));
  EXPECT_EQ(list.exports[0].of.study.uid, Now().study_uid);
}

TEST_F(DraftWorkTest, TheReviewPageLeadsToTheDraft) {
  WaitingDraft();
  ASSERT_OK_AND_ASSIGN(const ReviewQueue list, ReadReviewQueue(queue_.get()));
  const ReviewPageOptions options = {.planner_url = "https://planner.example.org/"};
  const std::string page = ReviewPage(list, options);
  EXPECT_THAT(page, HasSubstr("waits in the planner for a plan"));
  EXPECT_THAT(page, HasSubstr("https://planner.example.org/#new&amp;draft=1\""));
  NewestDraft().add_cases("cases/1");
  ASSERT_THAT(plans_.FollowDrafts(), IsOk());
  ASSERT_OK_AND_ASSIGN(const ReviewQueue later, ReadReviewQueue(queue_.get()));
  EXPECT_THAT(ReviewPage(later, options), Not(HasSubstr("draft=")));
}

}  // namespace
}  // namespace tissueform::testing
