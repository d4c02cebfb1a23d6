// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/network/instance_folder.h"
#include "client/pacs_bridge/network/storage_receiver.h"
#include "client/pacs_bridge/work/intake_sink.h"
#include "client/pacs_bridge/work/plan_work.h"
#include "client/pacs_bridge/work/series_intake.h"
#include "core/base/parallel_for.h"
#include "core/planning/plan_building/plan_build_call.h"
#include "tests/client/pacs_bridge/network/dicom_peers.h"
#include "tests/integration/service_test.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"
#include "tests/testing/test_paths.h"

// A CT that DCMTK's storescu sends to the bridge waits on the server as a draft; a plan of it is
// one of its study. The head is that of tests/data, of an invented patient.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

// Coarse, and cut off above: by a plane of `above`.
std::string Recipe(const std::string& above) {
  return absl::StrCat(R"({"format": "tissueform-recipe", "version": 6, "spacing_mm": 4,
    "mesh": {"edge_mm": 8, "fine_edge_mm": 8}, "region_of_interest": {"above": )",
                      above, R"(, "back": {"point_mm": [0, 100, 0], "normal": [0, -1, 0]}},
    "segments": [{"name": "mandible", "osteotomy": "bssro",
                  "pose": {"translation_mm": [0, -4, 0]}}]})");
}
constexpr char kAbove[] = R"({"point_mm": [0, 0, -50], "normal": [0, 0, -1]})";
constexpr char kMarkups[] =
    R"({"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm",
        "controlPoints": [{"position": [0, 0, -50]}, {"position": [9, 0, -50]},
                          {"position": [0, 9, -50]}]}]})";
// Of the patient and of the study, as the scanner names them.
constexpr std::array<const char*, 6> kPlanted = {"Planted",  "Patricia", "PLANTED-4711",
                                                 "19610203", "20260102", "Head soft"};

bool HasPydicom() {
  return std::system("/usr/bin/python3 -c 'import numpy, pydicom' 2>/dev/null") == 0;
}

class BridgeDraftsTest : public ServiceTest {
 protected:
  void SetUp() override {
    ASSERT_TRUE(HasPydicom()) << "python3-pydicom is not installed";
    ASSERT_TRUE(HasProgram("storescu")) << "storescu is absent: install dcmtk";
    ServerOptions options = TestOptions();
    options.in_memory = false;
    options.data_dir = root_ / "server";
    options.workers = AvailableProcessors();
    StartServer(options);
    std::ofstream(root_ / "recipe.json") << Recipe(kAbove);
    queue_ = *BridgeQueue::Open((root_ / "bridge").string());
    rows_ = std::make_unique<ReceivedRows>(queue_.get());
    case_server_ = *ConnectToCaseServer(address(), {});
    work_ = std::make_unique<PlanWork>(queue_.get(), case_server_.get(), PlanWorkOptions{});
    client_ = Connect();
  }
  void TearDown() override {
    client_.reset();
    case_server_.reset();
    StopServer();
  }

  // Writes the head as DICOM, sends it to a bridge whose rule wants drafts, and settles.
  QueuedSeries Receive() {
    const std::string write = absl::StrCat(
        "/usr/bin/python3 -B -c 'import sys\nsys.path.insert(0, \"", SourcePath("deploy/pacs"),
        "\")\nimport head_series\nhead_series.write_series(\"", Ct(),
        "\", name=\"Planted^Patricia\", patient_id=\"PLANTED-4711\", born=\"19610203\")\n'");
    EXPECT_EQ(std::system(write.c_str()), 0);
    SeriesIntake intake(queue_.get(), {.rules = {{.recipe = (root_ / "recipe.json").string(),
                                                  .draft = true,
                                                  .max_spacing_mm = 10,
                                                  .max_thickness_mm = 10}},
                                       .quiet = std::chrono::milliseconds(0)});
    IntakeSink sink(&intake);
    auto folder = InstanceFolder::Open({.path = queue_->received_folder(), .watermark_bytes = 0});
    EXPECT_THAT(folder, IsOk());
    auto receiver =
        StorageReceiver::Start({.calling_ae_titles = {"SCANNER"}}, folder->get(), &sink);
    EXPECT_THAT(receiver, IsOk());
    const ProgramEnd end =
        RunPeer("storescu", {"-aet", "SCANNER", "-aec", "TISSUEFORM", "+sd", "127.0.0.1",
                             absl::StrCat((*receiver)->port()), Ct()});
    EXPECT_EQ(end.exit_code, 0) << end.said;
    (*receiver)->Stop();
    for (int i = 0; i < 3; ++i) EXPECT_THAT(intake.Settle(), IsOk());
    const auto all = rows_->List();
    EXPECT_THAT(*all, SizeIs(1));
    return all->front();
  }
  std::string Ct() const { return (root_ / "ct").string(); }

  v1::PlanBuild Build(const v1::BuildDraft& draft) {
    v1::CreatePlanBuildRequest request;
    request.set_draft(draft.name());
    request.set_recipe_json(draft.recipe_json());
    const auto created = client_->plan_builds().Create(request);
    EXPECT_THAT(created, IsOk());
    const auto done = client_->plan_builds().Wait(created->name(), {});
    EXPECT_THAT(done, IsOk());
    return *done;
  }

  // Files of the server that hold the text, in their name or their bytes.
  std::vector<std::string> ServerHolds(const std::string& text) const {
    std::vector<std::string> found;
    for (const auto& entry : fs::recursive_directory_iterator(root_ / "server")) {
      const std::string path = entry.path().string();
      const bool holds = entry.is_regular_file() && absl::StrContains(BytesOfFile(path), text);
      if (holds || absl::StrContains(entry.path().filename().string(), text)) found.push_back(path);
    }
    return found;
  }

  const fs::path root_ = EmptyTestFolder("bridge_drafts");
  // Pictures need Xvfb and seconds, and no test here looks at them.
  const ScopedEnvironment no_pictures_{"DISPLAY", ""};
  std::unique_ptr<BridgeQueue> queue_;
  std::unique_ptr<ReceivedRows> rows_;
  std::unique_ptr<CaseServer> case_server_;
  std::unique_ptr<PlanWork> work_;
  std::unique_ptr<TissueformClient> client_;
};

TEST_F(BridgeDraftsTest, APlanOfADraftIsThatOfTheSeriesAndBelongsToItsStudy) {
  QueuedSeries series = Receive();
  ASSERT_EQ(series.state, SeriesState::kDrafting) << series.reason;
  EXPECT_TRUE(series.has_header) << "for what is stored in the study later";
  ASSERT_THAT(work_->Step(&series), IsOk());
  EXPECT_EQ(series.state, SeriesState::kDraft);
  EXPECT_THAT(*work_->FollowDrafts(), ::testing::IsEmpty()) << "nothing was built";

  ASSERT_OK_AND_ASSIGN(const std::vector<v1::BuildDraft> listed,
                       client_->plan_builds().ListDrafts());
  ASSERT_THAT(listed, SizeIs(1));
  EXPECT_EQ(listed[0].title(), TitleOfSeries(series.key));
  ASSERT_OK_AND_ASSIGN(const v1::BuildDraft draft,
                       client_->plan_builds().GetDraft(listed[0].name()));
  ASSERT_OK_AND_ASSIGN(const std::string ct, client_->plan_builds().ReadDraft(draft.name()));
  EXPECT_THAT(ct, HasSubstr("AnatomicalOrientation"));
  for (const char* text : kPlanted) {
    EXPECT_THAT(ct, Not(HasSubstr(text)));
    EXPECT_THAT(draft.SerializeAsString(), Not(HasSubstr(text)));
  }

  const v1::PlanBuild build = Build(draft);
  ASSERT_EQ(build.state(), v1::PLAN_BUILD_STATE_SUCCEEDED) << build.detail();
  EXPECT_THAT(*work_->FollowDrafts(), ElementsAre(series.key));
  ASSERT_OK_AND_ASSIGN(const QueuedSeries published, rows_->GetByCase(build.case_()));
  EXPECT_EQ(published.state, SeriesState::kPublished);
  EXPECT_EQ(published.study_uid, series.study_uid);
  EXPECT_THAT(*rows_->ListSources(build.case_()), SizeIs(93));

  // The same plan as `plan build` makes of the DICOM files.
  const fs::path here = root_ / "here";
  fs::create_directory(here);
  ASSERT_THAT(CallPlanBuild({.ct = Ct(),
                             .recipe = (root_ / "recipe.json").string(),
                             .folder = here.string(),
                             .folder_name = "plan",
                             .threads = AvailableProcessors(),
                             .pictures = false}),
              IsOk());
  for (const char* name : {"plan.json", "head.vtu"}) {
    ASSERT_OK_AND_ASSIGN(const std::string bytes,
                         client_->plan_builds().ReadFile(build.name(), name));
    EXPECT_EQ(bytes, BytesOfFile((here / name).string())) << name;
  }
  for (const char* text : kPlanted) EXPECT_THAT(ServerHolds(text), ::testing::IsEmpty());
  EXPECT_THAT(ServerHolds(TitleOfSeries(series.key)), Not(::testing::IsEmpty()))
      << "what is looked for would be found";
}

TEST_F(BridgeDraftsTest, RemovedDraftIsSentAgainOnlyOnRequest) {
  QueuedSeries series = Receive();
  ASSERT_THAT(work_->Step(&series), IsOk());
  ASSERT_OK_AND_ASSIGN(const std::vector<v1::BuildDraft> drafts,
                       client_->plan_builds().ListDrafts());
  ASSERT_THAT(drafts, SizeIs(1));
  ASSERT_THAT(client_->plan_builds().DeleteDraft(drafts[0].name()), IsOk());
  EXPECT_THAT(*work_->FollowDrafts(), ElementsAre(series.key));
  ASSERT_OK_AND_ASSIGN(const QueuedSeries lost, rows_->Get(series.key));
  EXPECT_EQ(lost.state, SeriesState::kFailed);
  EXPECT_THAT(lost.last_error, HasSubstr("tissueform-pacs draft"));
  EXPECT_THAT(*work_->FollowDrafts(), ::testing::IsEmpty());
  // Twice: the second takes the place of the first.
  for (int i = 0; i < 2; ++i) {
    SeriesIntake intake(queue_.get(), {});
    ASSERT_THAT(
        intake.Choose(*rows_->Get(series.key), series.recipe, "by hand", SeriesState::kDrafting),
        IsOk());
    ASSERT_OK_AND_ASSIGN(series, rows_->Get(series.key));
    ASSERT_THAT(work_->Step(&series), IsOk());
  }
  ASSERT_OK_AND_ASSIGN(const std::vector<v1::BuildDraft> now, client_->plan_builds().ListDrafts());
  EXPECT_THAT(now, SizeIs(1));
}

TEST_F(BridgeDraftsTest, ARecipeWithOtherFilesIsRefused) {
  std::ofstream(root_ / "above.mrk.json") << kMarkups;
  std::ofstream(root_ / "recipe.json") << Recipe(R"({"file": "above.mrk.json"})");
  QueuedSeries series = Receive();
  EXPECT_THAT(work_->Step(&series), StatusIs(absl::StatusCode::kFailedPrecondition,
                                             HasSubstr("names a label map or other files")));
  EXPECT_EQ(series.state, SeriesState::kFailed);
  EXPECT_THAT(*client_->plan_builds().ListDrafts(), ::testing::IsEmpty());
}

}  // namespace
}  // namespace tissueform::testing
