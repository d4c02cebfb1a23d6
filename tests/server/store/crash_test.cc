// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <csignal>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <unistd.h>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/process/child_process.h"
#include "tests/server/store/store_workload.h"
#include "tests/server/store/stores_case.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// kill -9 at named places of the write path and at random moments: all that was acknowledged is
// there, byte for byte. (The kernel keeps what a killed process has written: power_cut_test.cc
// looks at what was synced.)
namespace tissueform {
namespace {

using ::tissueform::testing::IsOk;

constexpr int kSteps = 3 * kStepsOfARound;

// How the writer ended, and how far it had come.
struct Death {
  int signal = 0;
  bool opened = false;
  int acknowledged = 0;  // steps
};

Death RunWriter(const std::string& folder, const std::vector<std::string>& how) {
  ChildOptions options;
  options.program = testing::ProgramPath("tissueform-store-writer");
  options.arguments = {folder, absl::StrCat(kSteps)};
  options.arguments.insert(options.arguments.end(), how.begin(), how.end());
  options.output = ChildStream::Pipe();
  const auto child = ChildProcess::Start(options);
  EXPECT_THAT(child.status(), IsOk());
  if (!child.ok()) return {};
  Death death;
  for (char said = 0; read((*child)->answer(), &said, 1) == 1;) {
    death.opened = true;
    death.acknowledged += said == 'a' ? 1 : 0;
  }
  death.signal = (*child)->Wait().signal;
  return death;
}

// Opens what is left and compares it with what was acknowledged.
void ExpectAllAcknowledged(const std::string& path, const Death& death) {
  StoreModel acknowledged;
  for (int number = 0; number < death.acknowledged; ++number)
    ApplyStep(number, /*bursts=*/true, &acknowledged);
  StoreModel begun = acknowledged;
  if (death.opened && death.acknowledged < kSteps)
    ApplyStep(death.acknowledged, /*bursts=*/true, &begun);
  auto folder = DataFolder::Open(path);
  ASSERT_THAT(folder, IsOk());
  const auto store = DurableStore::Open(*std::move(folder));
  ASSERT_THAT(store.status(), IsOk());
  EXPECT_THAT(CheckAgainst(acknowledged, begun, **store), IsOk())
      << death.acknowledged << " steps were acknowledged";
}

class FaultPointTest : public ::testing::TestWithParam<const char*> {};

TEST_P(FaultPointTest, AcknowledgedDataSurvivesAKill) {
  // The first time it may be passed while the store is made; the others come in later rounds.
  for (const int count : {1, 4}) {
    const ScratchFolder scratch;
    const Death death = RunWriter(scratch / "data", {"point", GetParam(), absl::StrCat(count)});
    EXPECT_TRUE(count > 1 || death.signal == SIGKILL) << "the point is never passed";
    ExpectAllAcknowledged(scratch / "data", death);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Points, FaultPointTest,
    ::testing::Values("file.created", "file.written", "file.synced", "file.renamed",
                      "file.folder_synced", "claim.blob_kept", "commit.before", "commit.after",
                      "commit.before_group", "commit.after_group", "commit.before_truncation",
                      "commit.truncated", "blob.before_removal", "blob.removed", "schema.changed",
                      "upload.part_made", "upload.announced", "upload.appended",
                      "upload.part_synced", "upload.mark_synced", "upload.announcement_removed"),
    [](const auto& of) {
      return absl::StrReplaceAll(of.param, {{".", "_"}});
    });

// TISSUEFORM_CRASHES: how many moments, 20 unless given.
TEST(CrashTest, AcknowledgedDataSurvivesAKillAtAnyMoment) {
  int crashes = 20;
  if (const char* given = std::getenv("TISSUEFORM_CRASHES")) {
    ASSERT_TRUE(absl::SimpleAtoi(given, &crashes));
  }
  std::mt19937 random(7);
  // Most are killed in the middle; some, on a fast machine, come to their end.
  std::uniform_int_distribution<int> microseconds(2'000, 200'000);
  int killed = 0;
  for (int crash = 0; crash < crashes; ++crash) {
    const ScratchFolder scratch;
    const Death death = RunWriter(scratch / "data", {"time", absl::StrCat(microseconds(random))});
    killed += death.signal == SIGKILL ? 1 : 0;
    ExpectAllAcknowledged(scratch / "data", death);
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(killed, 0);
}

}  // namespace
}  // namespace tissueform
