// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/audit_file.h"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/resource.h>
#include <sys/stat.h>

#include "server/platform/audit_chain/audit_verification.h"
#include "tests/testing/audit_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::LinesOf;
using testing::SampleKey;
using testing::StatusIs;

constexpr char kLine[] = "\"event\":\"call\"";

class AuditFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }

  std::unique_ptr<AuditFile> Open(const AuditKey& key = SampleKey()) const {
    auto file = AuditFile::Open(key, options_);
    EXPECT_THAT(file, IsOk());
    return file.ok() ? *std::move(file) : nullptr;
  }

  static std::string ReadAll(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_))
      names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }

  // Of all files but those that were set aside.
  AuditReport Verify(const AuditKey& key = SampleKey()) const {
    std::vector<std::string> paths;
    for (const std::string& name : Names()) {
      if (name.find(".torn-") == std::string::npos) paths.push_back(folder_ / name);
    }
    auto report = VerifyAuditFiles(paths, key);
    EXPECT_THAT(report, IsOk());
    if (!report.ok()) return {};
    EXPECT_FALSE(report->finding.has_value())
        << report->finding->file << ":" << report->finding->line << " " << report->finding->what;
    return *report;
  }

  const fs::path folder_ =
      fs::path(::testing::TempDir()) /
      absl::StrCat("audit_file_", ::testing::UnitTest::GetInstance()->current_test_info()->name());
  const fs::path path_ = folder_ / "audit.jsonl";
  AuditFile::Options options_ = {.path = path_.string()};
};

TEST_F(AuditFileTest, GoesOnWhereItEnded) {
  EXPECT_THAT(Open()->Append({kLine, kLine}), IsOk());
  EXPECT_THAT(Open()->Append({kLine}), IsOk());
  EXPECT_EQ(Verify().lines, 4);
  EXPECT_EQ(fs::status(path_).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(AuditFileTest, ATornLineOfACrashIsSetAsideAndNoted) {
  EXPECT_THAT(Open()->Append({kLine, kLine}), IsOk());
  const std::string whole = ReadAll(path_);
  const size_t last = LinesOf(whole).back().size();
  for (size_t kept = 1; kept < last; kept += 13) {
    const std::string torn = whole.substr(whole.size() - last, kept);
    testing::WriteFile(path_, whole.substr(0, whole.size() - last) + torn);
    EXPECT_THAT(Open()->Append({kLine}), IsOk());
    const AuditReport report = Verify();
    EXPECT_EQ(report.mended, 1) << kept << " bytes";
    EXPECT_EQ(report.lines, 4) << "head, call, mended, call";
    EXPECT_EQ(ReadAll(absl::StrCat(path_.string(), ".torn-3")), torn);
  }
}

TEST_F(AuditFileTest, NoughtsThatAPowerCutLeavesAreSetAside) {
  EXPECT_THAT(Open()->Append({kLine}), IsOk());
  testing::WriteFile(path_, ReadAll(path_) + std::string(5000, '\0'));
  EXPECT_THAT(Open()->Append({kLine}), IsOk());
  EXPECT_EQ(Verify().mended, 1);
}

TEST_F(AuditFileTest, ANewFileBeginsWhenOneIsFull) {
  options_.max_bytes = 1000;
  const auto file = Open();
  for (int i = 0; i < 20; ++i) EXPECT_THAT(file->Append({kLine}), IsOk());
  EXPECT_GT(Names().size(), 2);
  EXPECT_EQ(Names()[1], "audit.jsonl.000001");
  for (const std::string& name : Names()) EXPECT_LE(fs::file_size(folder_ / name), 1300);
  EXPECT_EQ(Verify().lines, 20 + Names().size());
}

TEST_F(AuditFileTest, AFileThatHasItsNameAlreadyIsLeft) {
  testing::WriteFile(path_.string() + ".000001", "another's\n");
  options_.max_bytes = 100;
  const auto file = Open();
  EXPECT_THAT(file->Append({kLine}), IsOk());
  EXPECT_EQ(Names(), (std::vector<std::string>{"audit.jsonl", "audit.jsonl.000001",
                                               "audit.jsonl.000001-1"}));
  EXPECT_EQ(ReadAll(path_.string() + ".000001"), "another's\n");
}

TEST_F(AuditFileTest, ANewFileBeginsOnANewDay) {
  absl::Time now = absl::FromUnixSeconds(1'000'000);
  options_.now = [&now] { return now; };
  const auto file = Open();
  EXPECT_THAT(file->Append({kLine}), IsOk());
  now += absl::Hours(24);
  EXPECT_THAT(file->Append({kLine}), IsOk());
  EXPECT_EQ(Names().size(), 2);
  Verify();
}

TEST_F(AuditFileTest, AFileThatWasMovedAwayIsFollowedByANewOne) {
  const auto file = Open();
  EXPECT_THAT(file->Append({kLine}), IsOk());
  fs::rename(path_, folder_ / "audit.jsonl.1");
  EXPECT_THAT(file->Append({kLine}), IsOk());
  EXPECT_EQ(Names(), (std::vector<std::string>{"audit.jsonl", "audit.jsonl.1"}));
  EXPECT_EQ(Verify().files, 2);
}

TEST_F(AuditFileTest, AFileThatWasMovedAwayBetweenTwoRunsIsFollowedByANewOne) {
  EXPECT_THAT(Open()->Append({kLine}), IsOk());
  fs::rename(path_, folder_ / "audit.jsonl.1");
  EXPECT_THAT(Open()->Append({kLine}), IsOk());
  EXPECT_EQ(Verify().lines, 4);
}

TEST_F(AuditFileTest, AFileThatSomebodyHasCutIsLeftAndTheNextBegins) {
  const auto file = Open();
  EXPECT_THAT(file->Append({kLine, kLine}), IsOk());
  fs::resize_file(path_, 0);
  EXPECT_THAT(file->Append({kLine}), IsOk());
  const auto report = VerifyAuditFiles({path_, path_.string() + ".000001"}, SampleKey());
  ASSERT_THAT(report, IsOk());
  EXPECT_EQ(report->finding->fault, AuditFault::kCut);
}

TEST_F(AuditFileTest, AnotherKeyBeginsAnotherFile) {
  EXPECT_THAT(Open()->Append({kLine}), IsOk());
  EXPECT_THAT(Open(SampleKey('n'))->Append({kLine}), IsOk());
  ASSERT_EQ(Names().size(), 2);
  fs::rename(path_, folder_.string() + ".new");
  Verify();
  fs::remove(folder_ / "audit.jsonl.000001");
  fs::rename(folder_.string() + ".new", path_);
  EXPECT_EQ(Verify(SampleKey('n')).first, 3);
}

TEST_F(AuditFileTest, TwoProcessesDoNotWriteTheSameLog) {
  const auto first = Open();
  EXPECT_THAT(AuditFile::Open(SampleKey(), options_),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("another process")));
}

TEST_F(AuditFileTest, AForeignFileIsNotOverwritten) {
  const auto file = Open();
  EXPECT_THAT(file->Append({kLine}), IsOk());
  fs::rename(path_, folder_ / "audit.jsonl.1");
  testing::WriteFile(path_, "somebody's\n");
  for (int i = 0; i < 2; ++i) {
    EXPECT_THAT(file->Append({kLine}),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("in the way")));
  }
  EXPECT_EQ(ReadAll(path_), "somebody's\n");
  fs::remove(path_);
  EXPECT_THAT(file->Append({kLine}), IsOk());
  EXPECT_EQ(Verify().lines, 4);
}

// As on a full disk: part of a line is written, then nothing more.
TEST_F(AuditFileTest, OfALineThatDoesNotFitOnTheDiskNothingIsLeft) {
  std::signal(SIGXFSZ, SIG_IGN);
  const auto file = Open();
  EXPECT_THAT(file->Append({kLine}), IsOk());
  const std::string whole = ReadAll(path_);
  rlimit before = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit full = {.rlim_cur = whole.size() + 40, .rlim_max = before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
  const absl::Status status = file->Append({kLine});
  const absl::Status again = file->Append({kLine});
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kUnavailable, HasSubstr("audit.jsonl")));
  EXPECT_THAT(again, StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_EQ(ReadAll(path_), whole);
  EXPECT_THAT(file->Append({kLine}), IsOk());
  EXPECT_EQ(Verify().lines, 3);
}

TEST_F(AuditFileTest, WhereNothingCanBeWrittenTheLogDoesNotOpen) {
  options_.path = "/dev/full";
  EXPECT_THAT(AuditFile::Open(SampleKey(), options_),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not a regular file")));
  options_.path = (folder_ / "none" / "audit.jsonl").string();
  EXPECT_THAT(AuditFile::Open(SampleKey(), options_),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("none/audit.jsonl")));
}

}  // namespace
}  // namespace tissueform
