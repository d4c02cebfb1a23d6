// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_progress.h"

#include <atomic>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/session/session_registry.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::tissueform::testing::FakeClock;
using ::tissueform::testing::IsOk;

TEST(ProgressPaceTest, EveryStageAndOfItsStepsTheNewestFiveTimesASecond) {
  FakeClock clock;
  ProgressPace pace(&clock);
  EXPECT_FALSE(pace.Take().has_value());
  pace.Offer({SessionStage::kWaiting});
  EXPECT_EQ(pace.Take()->stage, SessionStage::kWaiting);
  EXPECT_FALSE(pace.Take().has_value()) << "it was told";
  pace.Offer({SessionStage::kResponses, 0, 36});
  EXPECT_EQ(pace.Take()->stage, SessionStage::kResponses) << "at once: another stage";
  pace.Offer({SessionStage::kResponses, 12, 36});
  EXPECT_FALSE(pace.Take().has_value());
  pace.Offer({SessionStage::kResponses, 24, 36});
  clock.Advance(ProgressPace::kInterval);
  EXPECT_EQ(pace.Take()->step, 24);
  pace.Offer({SessionStage::kResponses, 36, 36});
  EXPECT_FALSE(pace.Take().has_value());
  pace.Offer({SessionStage::kKeeping});
  EXPECT_EQ(pace.Take()->stage, SessionStage::kKeeping);
}

TEST(ProgressPaceTest, NothingGoesBack) {
  FakeClock clock;
  ProgressPace pace(&clock);
  pace.Offer({SessionStage::kResponses, 24, 36});
  EXPECT_EQ(pace.Take()->step, 24);
  clock.Advance(ProgressPace::kInterval);
  pace.Offer({SessionStage::kAssembling});
  pace.Offer({SessionStage::kResponses, 12, 36});
  EXPECT_FALSE(pace.Take().has_value());
  pace.Offer({SessionStage::kResponses, 36, 36});
  EXPECT_EQ(pace.Take()->step, 36);
}

// What one listener has heard.
struct Heard {
  SessionProgressCallback Callback() {
    return [this](const SessionProgress& progress) { all.push_back(progress); };
  }
  std::vector<SessionStage> Stages() const {
    std::vector<SessionStage> stages;
    for (const SessionProgress& progress : all) {
      if (stages.empty() || stages.back() != progress.stage) stages.push_back(progress.stage);
    }
    return stages;
  }

  std::vector<SessionProgress> all;
};

TEST(ProgressFeedTest, ReachesFollowersOfTheTopicIncludingLateOnes) {
  ProgressFeed feed;
  Heard early;
  Heard other;
  Heard late;
  Heard after;
  auto follows = feed.Follow(1, early.Callback());
  const auto follows_other = feed.Follow(2, other.Callback());
  feed.Begin(1);
  feed.Report({SessionStage::kOrdering});
  const auto follows_late = feed.Follow(1, late.Callback());
  EXPECT_THAT(late.Stages(), ElementsAre(SessionStage::kOrdering)) << "at once";
  feed.Report({SessionStage::kFactorising});
  follows.reset();
  feed.Report({SessionStage::kResponses});
  feed.End();
  const auto follows_after = feed.Follow(1, after.Callback());
  EXPECT_THAT(early.Stages(), ElementsAre(SessionStage::kOrdering, SessionStage::kFactorising));
  EXPECT_THAT(late.Stages(), ElementsAre(SessionStage::kOrdering, SessionStage::kFactorising,
                                         SessionStage::kResponses));
  EXPECT_THAT(other.Stages(), IsEmpty());
  EXPECT_THAT(after.Stages(), IsEmpty()) << "it has ended";
}

// A server's inside without its network. One worker, so that a blocked worker holds everything.
class SessionProgressTest : public ::testing::Test {
 protected:
  using Made = absl::StatusOr<std::shared_ptr<Session>>;

  ~SessionProgressTest() override { pool_.reset(); }

  std::future<Made> Create(SessionRecord record, const SessionProgressCallback& on_progress) {
    auto promise = std::make_shared<std::promise<Made>>();
    registry_.loader().Create(
        std::move(record), bar_, std::make_shared<std::atomic<bool>>(),
        [promise](Made made) { promise->set_value(std::move(made)); }, on_progress);
    return promise->get_future();
  }

  SessionRecord Record(DeformationModel model) const {
    SessionRecord record = testing::BarRecord(*bar_);
    record.model = model;
    return record;
  }

  FakeClock clock_;
  ServiceLimits limits_;
  MemoryBudget budget_{64 << 20};
  MeshCatalog catalog_{limits_, &budget_, nullptr, &clock_};
  InMemorySessionStore store_;
  std::unique_ptr<WorkerPool> pool_ = std::make_unique<WorkerPool>(1);
  SessionRegistry registry_{limits_, &budget_, pool_.get(), &store_, &catalog_, &clock_};
  const std::shared_ptr<const StoredMesh> bar_ =
      testing::Store(testing::SampleMesh(testing::Bar({2, 2, 3})), &catalog_);
};

TEST_F(SessionProgressTest, ACreationReportsEveryStage) {
  Heard heard;
  ASSERT_THAT(Create(Record(DeformationModel::kLinearElastic), heard.Callback()).get(), IsOk());
  EXPECT_THAT(heard.Stages(), ElementsAre(SessionStage::kWaiting, SessionStage::kAssembling,
                                          SessionStage::kOrdering, SessionStage::kFactorising,
                                          SessionStage::kResponses, SessionStage::kKeeping));
  EXPECT_EQ(heard.all[heard.all.size() - 2], (SessionProgress{SessionStage::kResponses, 12, 12}));
}

TEST_F(SessionProgressTest, SharedPreparationReportsToAllSessionsThatNeedIt) {
  // All three share it; the third needs another factor.
  std::promise<void> go;
  pool_->Post(Lane::kBatch, [&go] { go.get_future().wait(); });
  Heard second;
  Heard third;
  std::vector<SessionStage> second_before;
  std::vector<SessionStage> third_before;
  Heard first;
  auto one = Create(Record(DeformationModel::kLinearElastic), [&](const SessionProgress& progress) {
    first.all.push_back(progress);
    if (progress.stage == SessionStage::kKeeping) {
      second_before = second.Stages();
      third_before = third.Stages();
    }
  });
  auto two = Create(Record(DeformationModel::kNeoHookean), second.Callback());
  auto three = Create(Record(DeformationModel::kGradientField), third.Callback());
  go.set_value();
  ASSERT_THAT(one.get(), IsOk());
  ASSERT_THAT(two.get(), IsOk());
  ASSERT_THAT(three.get(), IsOk());
  EXPECT_THAT(second_before, ElementsAre(SessionStage::kWaiting, SessionStage::kAssembling,
                                         SessionStage::kOrdering, SessionStage::kFactorising,
                                         SessionStage::kResponses));
  EXPECT_THAT(third_before, ElementsAre(SessionStage::kWaiting));
  EXPECT_THAT(third.Stages(), ElementsAre(SessionStage::kWaiting, SessionStage::kAssembling,
                                          SessionStage::kOrdering, SessionStage::kFactorising,
                                          SessionStage::kResponses, SessionStage::kKeeping));
}

TEST_F(SessionProgressTest, AJoinedRequestReportsItsProgressAtOnce) {
  SessionRecord record = Record(DeformationModel::kGradientField);
  record.request_id = "id";
  record.request_fingerprint = "print";
  Heard joined;
  std::future<Made> two;
  auto one = Create(record, [&](const SessionProgress& progress) {
    if (progress.stage == SessionStage::kFactorising) two = Create(record, joined.Callback());
  });
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> session, one.get());
  ASSERT_OK_AND_ASSIGN(const std::shared_ptr<Session> same, two.get());
  EXPECT_EQ(session, same);
  EXPECT_THAT(joined.Stages(), ElementsAre(SessionStage::kFactorising, SessionStage::kResponses,
                                           SessionStage::kKeeping));
}

TEST_F(SessionProgressTest, UpdatesAndRestoresReportThatTheyRead) {
  SessionRecord record = Record(DeformationModel::kGradientField);
  record.id = "a";
  ASSERT_THAT(Create(record, nullptr).get(), IsOk());
  Heard updated;
  std::promise<absl::Status> update;
  registry_.loader().Update(
      "a", "",
      [](SessionRecord changed, const StoredMesh& /*mesh*/) {
        changed.stiffness = 500.0;
        return absl::StatusOr<SessionRecord>(std::move(changed));
      },
      std::make_shared<std::atomic<bool>>(),
      [&update](const absl::StatusOr<SessionView>& view) { update.set_value(view.status()); },
      updated.Callback());
  ASSERT_THAT(update.get_future().get(), IsOk());
  const auto expected = [](std::optional<SessionStage> last) {
    std::vector<SessionStage> stages = {SessionStage::kReadingMesh, SessionStage::kWaiting,
                                        SessionStage::kAssembling,  SessionStage::kOrdering,
                                        SessionStage::kFactorising, SessionStage::kResponses};
    if (last.has_value()) stages.push_back(*last);
    return stages;
  };
  EXPECT_EQ(updated.Stages(), expected(SessionStage::kKeeping));
  clock_.Advance(2 * SessionTable::kInUse);
  std::promise<void> drained;
  pool_->Post(Lane::kBatch, [&drained] { drained.set_value(); });
  drained.get_future().wait();
  ASSERT_EQ(registry_.table().Evict([] { return false; }), 1);
  Heard restored;
  std::promise<Made> opened;
  registry_.loader().Open(
      "a", std::make_shared<std::atomic<bool>>(),
      [&opened](Made session) { opened.set_value(std::move(session)); }, restored.Callback());
  ASSERT_THAT(opened.get_future().get(), IsOk());
  EXPECT_EQ(restored.Stages(), expected(std::nullopt));
}

}  // namespace
}  // namespace tissueform
