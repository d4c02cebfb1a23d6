// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/plan_build_call.h"

#include <array>
#include <csignal>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsOk;
using ::testing::Le;
using testing::StatusIs;

// The lower face alone, so coarse that it takes seconds.
constexpr char kRecipe[] =
    R"({"format": "tissueform-recipe", "version": 1,
        "ct": {"hu_offset": -1024, "axes": "RPI"}, "spacing_mm": 4,
        "mesh": {"edge_mm": 8, "fine_edge_mm": 8},
        "region_of_interest": {"above": {"point_mm": [0, 0, -50], "normal": [0, 0, -1]},
                               "back": {"point_mm": [0, 100, 0], "normal": [0, -1, 0]}},
        "segments": [{"name": "mandible", "osteotomy": "bssro",
                      "pose": {"translation_mm": [0, -4, 0]}}]})";

// Processes that this thread has started.
std::vector<pid_t> Children() {
  std::ifstream list(absl::StrCat("/proc/self/task/", gettid(), "/children"));
  std::vector<pid_t> children;
  for (pid_t child = 0; list >> child;) children.push_back(child);
  return children;
}

class PlanBuildCallTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    around_ = fs::path(::testing::TempDir()) / "plan_build_call_test" / info->name();
    fs::remove_all(around_);
    fs::create_directories(around_ / "folder");
    std::ofstream(around_ / "recipe.json") << kRecipe;
    request_.ct = testing::TestDataPath("ct/headsq/headsq_quarter.nhdr");
    request_.recipe = (around_ / "recipe.json").string();
    request_.folder = (around_ / "folder").string();
    request_.folder_name = "shown";
    request_.pictures = false;
  }
  void TearDown() override { fs::remove_all(around_); }

  // The outcome when the worker gets that signal as soon as it says what it does.
  absl::Status OutcomeAfter(int signal) const {
    return CallPlanBuild(request_, {.on_progress =
                                        [signal](absl::string_view, double) {
                                          for (const pid_t child : Children()) kill(child, signal);
                                        }})
        .status();
  }

  fs::path around_;
  PlanBuildRequest request_;
};

TEST_F(PlanBuildCallTest, FolderIsFilledStagesRiseAndTheTextNamesTheFolderAsAsked) {
  std::vector<std::string> stages;
  double done = 0;
  const auto made =
      CallPlanBuild(request_, {.on_progress = [&](absl::string_view stage, double fraction) {
                      stages.emplace_back(stage);
                      EXPECT_THAT(fraction, AllOf(Ge(done), Le(1)));
                      done = fraction;
                    }});
  ASSERT_THAT(made, IsOk());
  EXPECT_THAT(made->text, AllOf(HasSubstr("shown/plan.json"), HasSubstr("handle  mandible")));
  EXPECT_FALSE(made->ready) << "edges of 8 mm cut off lips and chin";
  EXPECT_THAT(made->defects, HasSubstr("CT skin"));
  EXPECT_EQ(stages.front(), "reading the CT");
  EXPECT_TRUE(fs::is_regular_file(around_ / "folder/plan.json"));
  EXPECT_TRUE(fs::is_regular_file(around_ / "folder/report.html"));
  EXPECT_THAT(Children(), IsEmpty());
}

TEST_F(PlanBuildCallTest, CancelledCallHasEndedItsWork) {
  std::array<int, 2> cancel{};
  ASSERT_EQ(pipe2(cancel.data(), O_CLOEXEC), 0);
  const auto text = CallPlanBuild(
      request_,
      {.on_progress = [&](absl::string_view, double) { close(std::exchange(cancel[1], -1)); },
       .cancel = cancel[0]});
  EXPECT_THAT(text, StatusIs(absl::StatusCode::kCancelled, HasSubstr("stopped")));
  EXPECT_THAT(Children(), IsEmpty());
  close(cancel[0]);
}

TEST_F(PlanBuildCallTest, DistinguishesKilledFromCrashedWorkers) {
  EXPECT_THAT(OutcomeAfter(SIGKILL),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("memory ran out")));
  EXPECT_THAT(OutcomeAfter(SIGUSR1),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("a library crashed (signal 10)")));
  EXPECT_THAT(Children(), IsEmpty());
}

TEST_F(PlanBuildCallTest, ErrorsOfTheWorkComeThrough) {
  request_.recipe = (around_ / "none.json").string();
  EXPECT_THAT(CallPlanBuild(request_),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none.json does not exist")));
  EXPECT_TRUE(fs::is_empty(around_ / "folder"));
}

}  // namespace
}  // namespace tissueform
