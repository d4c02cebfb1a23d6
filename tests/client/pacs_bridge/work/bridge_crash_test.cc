// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <csignal>
#include <filesystem>
#include <set>
#include <unistd.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/queue/received_rows.h"
#include "core/base/process/child_process.h"
#include "tests/client/pacs_bridge/work/bridge_world.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"
#include "tests/testing/test_paths.h"

// kill -9 at every place between two writes, from received files to objects in the PACS: the next
// process goes on, and the PACS has one of each object.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

// The issue asks for twenty.
constexpr int kLeastPoints = 20;
constexpr size_t kObjects = 4;
// From an export that is asked for to one that is asked for again, of a merged patient.
constexpr int kPointsToTheSecondQuestion = 10;

class BridgeCrashTest : public ::testing::Test {
 protected:
  void Begin(const std::string& name) {
    root_ = EmptyTestFolder(name);
    fs::create_directories(root_ / "world/server");
    fs::create_directories(root_ / "world/pacs");
    ASSERT_THAT(BridgeQueue::Open(state()), IsOk());
    series_ = WriteCtSeries(fs::path(state()) / "received");
  }
  // The PACS has given the series to another patient.
  void Merge() {
    CtSeriesOptions merged;
    merged.study_uid = series_.study_uid;
    merged.series_uid = series_.series_uid;
    merged.patient_id = "MERGED-1";
    fs::create_directories(root_ / "merged");
    fs::copy_file(WriteCtSeries(root_ / "merged", merged).files.front(),
                  root_ / "world/merged.dcm");
  }

  std::string state() const { return (root_ / "state").string(); }

  // Runs the steps; how they ended, and how many places were passed where they came to the end.
  ChildEnd Run(int kill_at, int* passed = nullptr) {
    ChildOptions options;
    options.program = ProgramPath("tissueform-bridge-steps");
    options.arguments = {state(), (root_ / "world").string(), absl::StrCat(kill_at)};
    options.output = ChildStream::Pipe();
    options.errors = ChildStream::File((root_ / "log").string());
    const auto child = ChildProcess::Start(options);
    EXPECT_THAT(child.status(), IsOk());
    std::string text;
    for (char c = 0; read((*child)->answer(), &c, 1) == 1 && c != '\n';) text += c;
    if (passed != nullptr) {
      EXPECT_TRUE(absl::SimpleAtoi(text, passed)) << text;
    }
    return (*child)->Wait();
  }

  void ExpectOneOfEach() {
    const std::vector<std::string> stores = LinesOfFile(root_ / "world/pacs/stores");
    const std::set<std::string> different(stores.begin(), stores.end());
    EXPECT_EQ(different.size(), kObjects);
    size_t files = 0;
    for (const auto& file : fs::directory_iterator(root_ / "world/pacs")) {
      files += file.path().filename() != "stores" ? 1 : 0;
    }
    EXPECT_EQ(files, kObjects) << "each object is in the PACS under one name";
    const auto queue = BridgeQueue::Open(state());
    ASSERT_THAT(queue, IsOk());
    EXPECT_EQ(ReceivedRows(queue->get()).List()->size(), 1);
    EXPECT_EQ(ExportRows(queue->get()).Get("exports/1")->state, BridgeExportState::kReported);
    EXPECT_EQ(stores.size(), kObjects) << "nothing was sent twice";
  }

  fs::path root_;
  CtSeries series_;
};

TEST_F(BridgeCrashTest, CrashAtAnyPointLeavesOneOfEachObject) {
  Begin("bridge_crash_none");
  int points = 0;
  ASSERT_EQ(Run(0, &points).exit_code, 0);
  ExpectOneOfEach();
  ASSERT_GE(points, kLeastPoints);
  for (int point = 1; point <= points; ++point) {
    SCOPED_TRACE(absl::StrCat("killed at place ", point, " of ", points));
    Begin("bridge_crash");
    ASSERT_EQ(Run(point).signal, SIGKILL);
    ASSERT_EQ(Run(0).exit_code, 0);
    ExpectOneOfEach();
  }
}

TEST_F(BridgeCrashTest, RepeatedCrashesStillReachTheEnd) {
  Begin("bridge_crash_often");
  ChildEnd end{.signal = SIGKILL};
  // A process that dies at its sixteenth place each time still comes on, step by step.
  for (int i = 0; i < 100 && end.signal == SIGKILL; ++i) end = Run(16);
  EXPECT_EQ(end.exit_code, 0);
  ExpectOneOfEach();
}

TEST_F(BridgeCrashTest, NoteAboutMergedPatientSurvivesEveryCrash) {
  Begin("bridge_crash_merged_none");
  Merge();
  int points = 0;
  ASSERT_EQ(Run(0, &points).exit_code, 0);
  // What is written after that it is asked again differs in nothing from the other test.
  ASSERT_GT(points, kPointsToTheSecondQuestion);
  for (int point = 1; point <= kPointsToTheSecondQuestion; ++point) {
    SCOPED_TRACE(absl::StrCat("killed at place ", point, " of ", points));
    Begin("bridge_crash_merged");
    Merge();
    ASSERT_EQ(Run(point).signal, SIGKILL);
    ASSERT_EQ(Run(0).exit_code, 0);
    ExpectOneOfEach();
    const auto queue = BridgeQueue::Open(state());
    ASSERT_THAT(queue, IsOk());
    EXPECT_THAT(ExportRows(queue->get()).Get("exports/1")->note,
                ::testing::HasSubstr("another patient ID"));
  }
}

}  // namespace
}  // namespace tissueform::testing
