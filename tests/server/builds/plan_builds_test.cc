// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/builds/plan_builds.h"

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <poll.h>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/mutex.h"
#include "core/mesh/payload/sha256.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Code = absl::StatusCode;

// Stands for the programs that build: each build waits until it is let go, or cancelled.
class Builder {
 public:
  absl::StatusOr<BuiltPlan> operator()(const PlanBuildJob& job) {
    job.on_stage("cutting the bone", 0.5);
    {
      MutexLock lock(mutex_);
      begun_.push_back(job.request.title());
    }
    while (!MayGo()) {
      pollfd cancel = {.fd = job.cancel, .events = POLLIN, .revents = 0};
      if (poll(&cancel, 1, 1) > 0) return absl::CancelledError("cancelled");
    }
    std::filesystem::create_directories(job.result_folder + "/pictures");
    std::ofstream(job.result_folder + "/report.json") << "{}";
    std::ofstream(job.result_folder + "/pictures/skin.png") << "png";
    if (job.request.title() == "bad") return absl::InvalidArgumentError("the CT holds no head");
    return BuiltPlan{.case_sha256 = std::string(64, 'c'), .is_ready = true, .summary = "made"};
  }

  void LetGo(int builds) {
    MutexLock lock(mutex_);
    let_go_ += builds;
  }
  std::vector<std::string> begun() const {
    MutexLock lock(mutex_);
    return begun_;
  }

 private:
  bool MayGo() {
    MutexLock lock(mutex_);
    if (let_go_ == 0) return false;
    --let_go_;
    return true;
  }

  mutable Mutex mutex_;
  int let_go_ ABSL_GUARDED_BY(mutex_) = 0;
  std::vector<std::string> begun_ ABSL_GUARDED_BY(mutex_);
};

class PlanBuildsTest : public ::testing::Test {
 protected:
  void SetUp() override { Open(); }
  void TearDown() override { builds_.reset(); }

  void Open() {
    builds_.reset();
    const auto clock = [this] { return now_s_.load(); };
    auto files = BuildFiles::Open(folder_ + "/files", limits_, clock);
    ASSERT_THAT(files, IsOk());
    files_ = *std::move(files);
    auto drafts = BuildDrafts::Open(folder_ + "/drafts", limits_, files_.get(), clock);
    ASSERT_THAT(drafts, IsOk());
    drafts_ = *std::move(drafts);
    auto builds = PlanBuilds::Open(
        folder_ + "/plans", limits_, 1, files_.get(), drafts_.get(),
        [this](const PlanBuildJob& job) { return builder_(job); }, clock);
    ASSERT_THAT(builds, IsOk());
    builds_ = *std::move(builds);
  }

  // A request for a file of its own.
  v1::CreatePlanBuildRequest Request(const std::string& title, const std::string& owner = "ann") {
    const std::string bytes = absl::StrCat("volume of ", title);
    const BuildFileRecord announced{.sha256 = Sha256Hex({bytes}),
                                    .owner = owner,
                                    .suffix = ".nrrd",
                                    .total_bytes = static_cast<int64_t>(bytes.size())};
    const auto file = files_->Begin(announced);
    EXPECT_THAT(file, IsOk());
    if (!file->is_whole()) {
      EXPECT_THAT(files_->Append(*file, 0, bytes), IsOk());
    }
    EXPECT_THAT(files_->Commit(*file), IsOk());
    v1::CreatePlanBuildRequest request;
    request.set_ct("buildFiles/" + announced.sha256);
    request.set_recipe_json("{}");
    request.set_title(title);
    return request;
  }
  std::string Create(const std::string& title, const std::string& owner = "ann") {
    const auto build = builds_->Create(owner, Request(title, owner));
    EXPECT_THAT(build, IsOk());
    return build.ok() ? IdOf(*build) : "";
  }
  static std::string IdOf(const v1::PlanBuild& build) {
    return build.name().substr(build.name().find('/') + 1);
  }

  // Once it is in the state; a test that waits in vain fails by this line.
  v1::PlanBuild WaitFor(const std::string& id, v1::PlanBuildState state,
                        const std::string& owner = "ann") {
    v1::PlanBuild last;
    for (int i = 0; i < 20'000; ++i) {
      const auto found = builds_->Find(owner, id);
      if (found.ok()) last = *found;
      if (found.ok() && found->state() == state) return *found;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ADD_FAILURE() << "build " << id << " is " << last.ShortDebugString();
    return last;
  }

  const std::string folder_ = EmptyTestFolder("plan_builds").string();
  PlanBuildLimits limits_;
  Builder builder_;
  std::atomic<int64_t> now_s_ = 1'000'000;
  std::unique_ptr<BuildFiles> files_;
  std::unique_ptr<BuildDrafts> drafts_;
  std::unique_ptr<PlanBuilds> builds_;
};

// A draft of the bridge, whose CT ann builds from.
class DraftsTest : public PlanBuildsTest {
 protected:
  v1::BuildDraft Draft(const std::string& title = "Case 1a2b3c4d") {
    v1::CreateBuildDraftRequest request;
    request.set_ct(Request("received", "bridge").ct());
    request.set_title(title);
    request.set_recipe_json("{}");
    const auto draft = drafts_->Create("bridge", request);
    EXPECT_THAT(draft, IsOk());
    return *draft;
  }
  static std::string IdOf(const v1::BuildDraft& draft) { return draft.name().substr(12); }
  static std::string FileOf(const v1::BuildDraft& draft) { return draft.ct().substr(11); }

  // As the service does it for who may.
  std::string BuildOf(const v1::BuildDraft& draft) {
    EXPECT_THAT(files_->Adopt("bridge", FileOf(draft), "ann"), IsOk());
    v1::CreatePlanBuildRequest request;
    request.set_draft(draft.name());
    request.set_ct(draft.ct());
    request.set_recipe_json("{}");
    const auto build = builds_->Create("ann", request);
    EXPECT_THAT(build, IsOk());
    return PlanBuildsTest::IdOf(*build);
  }
  void PassHours(int64_t hours) {
    now_s_ += hours * 3600;
    builds_->RemoveExpired();
  }
};

TEST_F(PlanBuildsTest, RunsOneAtATimeInOrder) {
  const std::string first = Create("first");
  const std::string second = Create("second", "bob");
  const std::string third = Create("third");
  EXPECT_EQ(WaitFor(first, v1::PLAN_BUILD_STATE_RUNNING).stage(), "cutting the bone");
  EXPECT_EQ(WaitFor(third, v1::PLAN_BUILD_STATE_WAITING).builds_before(), 2);
  builder_.LetGo(3);
  const v1::PlanBuild done = WaitFor(third, v1::PLAN_BUILD_STATE_SUCCEEDED);
  EXPECT_EQ(done.case_(), "cases/" + std::string(64, 'c'));
  ASSERT_EQ(done.files_size(), 2);
  EXPECT_EQ(done.files(0).path(), "pictures/skin.png");
  EXPECT_EQ(done.files(1).total_bytes(), 2);
  EXPECT_THAT(builder_.begun(), ElementsAre("first", "second", "third"));
  EXPECT_EQ(builds_->CountOpen(), 0);
}

TEST_F(PlanBuildsTest, TheFilesOfABuildGoWithIt) {
  const auto request = Request("first");
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild first, builds_->Create("ann", request));
  auto kept = Request("kept");
  kept.set_keep_files(true);
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild second, builds_->Create("ann", kept));
  builder_.LetGo(2);
  WaitFor(IdOf(second), v1::PLAN_BUILD_STATE_SUCCEEDED);
  builds_.reset();  // all is done
  EXPECT_THAT(files_->Find("ann", request.ct().substr(11)), StatusIs(Code::kNotFound));
  EXPECT_THAT(files_->Find("ann", kept.ct().substr(11)), IsOk());
}

TEST_F(PlanBuildsTest, AFileThatIsAnnouncedAgainStaysForTheNextBuild) {
  const auto request = Request("first");
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild first, builds_->Create("ann", request));
  // While it is built its owner learns that the file is there, and will build from it once more.
  ASSERT_THAT(files_->Ask("ann", request.ct().substr(11)), IsOk());
  builder_.LetGo(1);
  WaitFor(IdOf(first), v1::PLAN_BUILD_STATE_SUCCEEDED);
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild second, builds_->Create("ann", request));
  builder_.LetGo(1);
  WaitFor(IdOf(second), v1::PLAN_BUILD_STATE_SUCCEEDED);
  builds_.reset();  // all is done
  EXPECT_THAT(files_->Find("ann", request.ct().substr(11)), StatusIs(Code::kNotFound));
}

TEST_F(PlanBuildsTest, AFailureSaysWhyAndLeavesNothing) {
  const std::string bad = Create("bad");
  builder_.LetGo(1);
  const v1::PlanBuild failed = WaitFor(bad, v1::PLAN_BUILD_STATE_FAILED);
  EXPECT_EQ(failed.detail(), "the CT holds no head");
  EXPECT_EQ(failed.files_size(), 0);
  EXPECT_FALSE(std::filesystem::exists(absl::StrCat(folder_, "/plans/", bad, "/plan")));
  EXPECT_FALSE(std::filesystem::exists(absl::StrCat(folder_, "/plans/", bad, "/work")));
}

TEST_F(PlanBuildsTest, CancelsWaitingAndRunningBuilds) {
  const std::string running = Create("running");
  const std::string waiting = Create("waiting");
  WaitFor(running, v1::PLAN_BUILD_STATE_RUNNING);
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild ended, builds_->Cancel("ann", waiting));
  EXPECT_EQ(ended.state(), v1::PLAN_BUILD_STATE_CANCELLED);
  EXPECT_THAT(builds_->Remove("ann", running), StatusIs(Code::kFailedPrecondition));
  ASSERT_THAT(builds_->Cancel("ann", running), IsOk());
  WaitFor(running, v1::PLAN_BUILD_STATE_CANCELLED);
  EXPECT_THAT(builds_->Remove("ann", running), IsOk());
  EXPECT_THAT(builds_->Find("ann", running), StatusIs(Code::kNotFound));
}

TEST_F(PlanBuildsTest, HidesABuildFromOtherPrincipals) {
  const std::string id = Create("first");
  for (const absl::Status& status :
       {builds_->Find("bob", id).status(), builds_->Cancel("bob", id).status(),
        builds_->Remove("bob", id), builds_->PathOf("bob", id, "report.json").status()}) {
    EXPECT_EQ(status.message(), absl::StrCat("no plan build ", id, " (any more)"));
  }
  EXPECT_TRUE(builds_->List("bob", "", 10).builds.empty());
  // Nor may it be built from another's file.
  EXPECT_THAT(builds_->Create("bob", Request("first")), StatusIs(Code::kNotFound));
}

TEST_F(PlanBuildsTest, ARepeatedRequestIsTheSameBuild) {
  auto request = Request("first");
  request.set_request_id("one");
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild first, builds_->Create("ann", request));
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild again, builds_->Create("ann", request));
  EXPECT_EQ(first.name(), again.name());
  request.set_recipe_json("{\"other\": 1}");
  EXPECT_THAT(builds_->Create("ann", request), StatusIs(Code::kInvalidArgument));
}

TEST_F(PlanBuildsTest, LimitsHold) {
  limits_.max_waiting = 3;
  limits_.max_waiting_of_principal = 2;
  limits_.max_per_day = 3;
  Open();
  Create("1");
  Create("2");
  EXPECT_THAT(builds_->Create("ann", Request("3")),
              StatusIs(Code::kResourceExhausted, HasSubstr("--quota-plan-builds)")));
  Create("4", "bob");
  EXPECT_THAT(builds_->Create("bob", Request("5", "bob")),
              StatusIs(Code::kResourceExhausted, HasSubstr("--max-plan-builds")));
  builder_.LetGo(3);
  for (const v1::PlanBuild& build : builds_->List("ann", "", 10).builds) {
    WaitFor(IdOf(build), v1::PLAN_BUILD_STATE_SUCCEEDED);
  }
  const std::string third = Create("6");
  builder_.LetGo(1);
  WaitFor(third, v1::PLAN_BUILD_STATE_SUCCEEDED);
  const auto of_a_day =
      StatusIs(Code::kResourceExhausted, HasSubstr("--quota-plan-builds-per-day"));
  EXPECT_THAT(builds_->Create("ann", Request("7")), of_a_day);
  EXPECT_THAT(builds_->Remove("ann", third), IsOk());
  EXPECT_THAT(builds_->Create("ann", Request("7")), of_a_day) << "a removed build counts";
}

TEST_F(PlanBuildsTest, PagesHoldEachBuildOnce) {
  std::vector<std::string> created;
  created.reserve(5);
  for (int i = 0; i < 5; ++i) created.push_back(Create(absl::StrCat(i)));
  std::vector<std::string> listed;
  for (std::string after;;) {
    const PlanBuilds::Page page = builds_->List("ann", after, 2);
    for (const v1::PlanBuild& build : page.builds) listed.push_back(IdOf(build));
    after = page.next;
    if (after.empty()) break;
  }
  EXPECT_EQ(listed, created);
}

// What was promised survives any number of ends at any time: each build ends once, in a state that
// follows, and none that succeeded is built again.
TEST_F(PlanBuildsTest, LosesAndRepeatsNoBuildOverManyRestarts) {
  limits_.max_waiting = 1'000;
  limits_.max_waiting_of_principal = 1'000;
  limits_.max_per_day = 1'000;
  Open();
  std::mt19937 random(1);
  std::map<std::string, v1::PlanBuildState> ended;
  std::vector<std::string> all;
  for (int step = 0; step < 200; ++step) {
    switch (random() % 5) {
      case 0:
      case 1:
        all.push_back(Create(absl::StrCat("plan ", step)));
        break;
      case 2:
        builder_.LetGo(1);
        break;
      case 3:
        if (!all.empty()) {
          EXPECT_THAT(builds_->Cancel("ann", all[random() % all.size()]), IsOk());
        }
        break;
      default:
        Open();
    }
    for (const std::string& id : all) {
      ASSERT_OK_AND_ASSIGN(const v1::PlanBuild build, builds_->Find("ann", id));
      const auto before = ended.find(id);
      if (before != ended.end()) {
        EXPECT_EQ(build.state(), before->second) << id;
      }
      if (build.state() >= v1::PLAN_BUILD_STATE_SUCCEEDED) ended[id] = build.state();
    }
  }
  builder_.LetGo(1'000);
  for (const std::string& id : all) {
    for (int i = 0;
         i < 20'000 && builds_->Find("ann", id)->state() < v1::PLAN_BUILD_STATE_SUCCEEDED; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_GE(builds_->Find("ann", id)->state(), v1::PLAN_BUILD_STATE_SUCCEEDED) << id;
  }
  std::vector<std::string> begun = builder_.begun();
  std::sort(begun.begin(), begun.end());
  EXPECT_EQ(std::adjacent_find(begun.begin(), begun.end()), begun.end()) << "built twice";
}

TEST_F(PlanBuildsTest, ABuildThatRanWhenTheServerEndedHasFailed) {
  const std::string id = Create("first");
  WaitFor(id, v1::PLAN_BUILD_STATE_RUNNING);
  Open();
  const v1::PlanBuild failed = WaitFor(id, v1::PLAN_BUILD_STATE_FAILED);
  EXPECT_THAT(failed.detail(), HasSubstr("build it again"));
}

TEST_F(DraftsTest, ADraftOutlivesARestartWithItsCt) {
  const v1::BuildDraft draft = Draft();
  EXPECT_EQ(draft.total_bytes(), 18);
  EXPECT_EQ(draft.suffix(), ".nrrd");
  Open();
  ASSERT_OK_AND_ASSIGN(const v1::BuildDraft found, drafts_->Find(IdOf(draft)));
  EXPECT_EQ(found.SerializeAsString(), draft.SerializeAsString());
  EXPECT_EQ(Draft().name(), draft.name()) << "the same again";
  EXPECT_NE(Draft("Case 2").name(), draft.name());
  EXPECT_EQ(drafts_->List().size(), 2U);
}

TEST_F(DraftsTest, ADraftNeedsAWholeFileOfItsOwner) {
  v1::CreateBuildDraftRequest request;
  request.set_ct(Request("received", "ann").ct());
  EXPECT_THAT(drafts_->Create("bridge", request), StatusIs(Code::kNotFound));
  const BuildFileRecord begun{
      .sha256 = std::string(64, 'a'), .owner = "bridge", .suffix = ".mha", .total_bytes = 9};
  ASSERT_THAT(files_->Begin(begun), IsOk());
  request.set_ct("buildFiles/" + begun.sha256);
  EXPECT_THAT(drafts_->Create("bridge", request),
              StatusIs(Code::kFailedPrecondition, HasSubstr("0 of 9 bytes")));
}

TEST_F(DraftsTest, QuotaCountsOnlyWaitingDrafts) {
  limits_.max_drafts_of_principal = 1;
  Open();
  const v1::BuildDraft draft = Draft();
  v1::CreateBuildDraftRequest other;
  other.set_ct(draft.ct());
  EXPECT_THAT(drafts_->Create("bridge", other),
              StatusIs(Code::kResourceExhausted, HasSubstr("--quota-drafts")));
  ASSERT_THAT(drafts_->AddCase(IdOf(draft), "cases/1"), IsOk());
  EXPECT_THAT(drafts_->Create("bridge", other), IsOk());
}

TEST_F(DraftsTest, ItsCasesAreNotedAndItsCtStaysForTheNextBuild) {
  const v1::BuildDraft draft = Draft();
  const std::string build = BuildOf(draft);
  EXPECT_THAT(builds_->RemoveDraft(draft),
              StatusIs(Code::kFailedPrecondition, HasSubstr("cancel the build first")));
  builder_.LetGo(1);
  WaitFor(build, v1::PLAN_BUILD_STATE_SUCCEEDED);
  ASSERT_OK_AND_ASSIGN(const v1::BuildDraft built, drafts_->Find(IdOf(draft)));
  EXPECT_THAT(built.cases(), ElementsAre("cases/" + std::string(64, 'c')));
  EXPECT_THAT(files_->Find("bridge", FileOf(draft)), IsOk());
  const std::string again = BuildOf(draft);
  builder_.LetGo(1);
  WaitFor(again, v1::PLAN_BUILD_STATE_SUCCEEDED);
  builds_.reset();  // all is done
  EXPECT_THAT(files_->Find("ann", FileOf(draft)), StatusIs(Code::kNotFound));
  EXPECT_EQ(drafts_->Find(IdOf(draft))->cases_size(), 1) << "the same case";
}

TEST_F(DraftsTest, AFailedBuildLeavesTheDraft) {
  const v1::BuildDraft draft = Draft();
  const std::string build = BuildOf(draft);
  WaitFor(build, v1::PLAN_BUILD_STATE_RUNNING);
  ASSERT_THAT(builds_->Cancel("ann", build), IsOk());
  WaitFor(build, v1::PLAN_BUILD_STATE_CANCELLED);
  EXPECT_TRUE(drafts_->Find(IdOf(draft))->cases().empty());
}

TEST_F(DraftsTest, TheOwnersOwnBuildKeepsTheCtOfTheDraft) {
  const v1::BuildDraft draft = Draft();
  v1::CreatePlanBuildRequest request;
  request.set_draft(draft.name());
  request.set_ct(draft.ct());
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild build, builds_->Create("bridge", request));
  builder_.LetGo(1);
  WaitFor(PlanBuildsTest::IdOf(build), v1::PLAN_BUILD_STATE_SUCCEEDED, "bridge");
  builds_.reset();  // all is done
  EXPECT_THAT(files_->Find("bridge", FileOf(draft)), IsOk());
}

TEST_F(DraftsTest, WithoutACaseItGoesWhenItsTimeIsOver) {
  const v1::BuildDraft draft = Draft();
  EXPECT_EQ(draft.expire_time().seconds(), now_s_ + limits_.draft_hours * 3600);
  PassHours(limits_.draft_hours - 1);
  EXPECT_THAT(drafts_->Find(IdOf(draft)), IsOk());
  EXPECT_THAT(files_->Find("bridge", FileOf(draft)), IsOk()) << "longer than other files";
  PassHours(1);
  EXPECT_THAT(drafts_->Find(IdOf(draft)), StatusIs(Code::kNotFound));
  EXPECT_THAT(files_->Find("bridge", FileOf(draft)), StatusIs(Code::kNotFound));
}

TEST_F(DraftsTest, ListsItsCasesForAMonthAfterItsCtHasGone) {
  const v1::BuildDraft draft = Draft();
  ASSERT_THAT(drafts_->AddCase(IdOf(draft), "cases/1"), IsOk());
  PassHours(limits_.retention_hours);
  EXPECT_THAT(files_->Find("bridge", FileOf(draft)), StatusIs(Code::kNotFound));
  Open();
  EXPECT_THAT(drafts_->Find(IdOf(draft))->cases(), ElementsAre("cases/1"));
  PassHours(30 * 24);
  EXPECT_THAT(drafts_->Find(IdOf(draft)), StatusIs(Code::kNotFound));
}

TEST_F(DraftsTest, RemovingItRemovesItsCt) {
  const v1::BuildDraft draft = Draft();
  const v1::BuildDraft twin = Draft("Case 2");
  ASSERT_THAT(builds_->RemoveDraft(draft), IsOk());
  EXPECT_THAT(files_->Find("bridge", FileOf(draft)), IsOk()) << "the other draft needs it";
  ASSERT_THAT(builds_->RemoveDraft(twin), IsOk());
  EXPECT_THAT(files_->Find("bridge", FileOf(draft)), StatusIs(Code::kNotFound));
  EXPECT_THAT(builds_->RemoveDraft(draft), StatusIs(Code::kNotFound));
  Open();
  EXPECT_TRUE(drafts_->List().empty());
}

TEST_F(DraftsTest, IgnoresDamagedRecords) {
  const v1::BuildDraft draft = Draft();
  std::ofstream(folder_ + "/drafts/" + IdOf(draft)) << "damaged";
  Open();
  EXPECT_TRUE(drafts_->List().empty());
}

}  // namespace
}  // namespace tissueform::testing
