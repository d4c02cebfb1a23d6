// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit_chain/audit_verification.h"

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/audit_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::Joined;
using testing::LinesOf;
using testing::SampleKey;
using testing::SampleLog;
using testing::StatusIs;

class AuditVerificationTest : public ::testing::Test {
 protected:
  AuditReport Verify(const std::vector<std::string>& files, const AuditKey& key = SampleKey(),
                     const std::vector<AuditCheckpoint>& checkpoints = {}) const {
    std::vector<std::string> paths;
    for (const std::string& file : files) {
      const std::string path = absl::StrCat(
          ::testing::TempDir(), "audit_",
          ::testing::UnitTest::GetInstance()->current_test_info()->name(), "_", paths.size());
      std::remove(path.c_str());  // one that takes another's place is synced, which takes long
      paths.push_back(testing::WriteFile(path, file));
    }
    auto report = VerifyAuditFiles(paths, key, checkpoints);
    EXPECT_THAT(report, IsOk());
    return report.ok() ? *report : AuditReport{};
  }

  static std::string Found(const AuditReport& report) {
    if (!report.finding.has_value()) return "ok";
    return absl::StrCat(AuditFaultName(report.finding->fault), " ", report.finding->line);
  }

  // Of one file of five lines, done to it what `change` does.
  template <typename Change>
  std::string After(Change change) const {
    std::vector<std::string> lines = LinesOf(SampleLog({5}).front());
    change(lines);
    return Found(Verify({Joined(lines)}));
  }
};

TEST_F(AuditVerificationTest, WhatTheChainWroteIsRightInAnyOrderOfFiles) {
  std::vector<std::string> files = SampleLog({5, 3, 1, 4});
  std::swap(files[0], files[2]);
  const AuditReport report = Verify(files);
  EXPECT_EQ(Found(report), "ok");
  EXPECT_EQ(report.files, 4);
  EXPECT_EQ(report.lines, 13);
  EXPECT_EQ(report.first, 1);
  EXPECT_EQ(report.last.number, 13);
}

TEST_F(AuditVerificationTest, AFileIsVerifiedByItself) {
  const std::vector<std::string> files = SampleLog({5, 3, 4});
  const AuditReport report = Verify({files[1], files[2]});
  EXPECT_EQ(Found(report), "ok");
  EXPECT_EQ(report.first, 6);
}

TEST_F(AuditVerificationTest, AnyByteThatIsChangedIsFound) {
  const std::string file = SampleLog({3}).front();
  for (size_t i = 0; i < file.size(); ++i) {
    for (const char mask : {'\x01', '\x80'}) {
      std::string changed = file;
      changed[i] = static_cast<char>(changed[i] ^ mask);
      EXPECT_NE(Found(Verify({changed})), "ok") << "byte " << i << " with " << int{mask};
    }
  }
}

TEST_F(AuditVerificationTest, AnyByteThatIsTakenOutOrPutInIsFound) {
  const std::string file = SampleLog({3}).front();
  for (size_t i = 0; i < file.size(); ++i) {
    std::string shorter = file;
    shorter.erase(i, 1);
    EXPECT_NE(Found(Verify({shorter})), "ok") << "without byte " << i;
    for (const char byte : {' ', '\n'}) {
      std::string longer = file;
      longer.insert(i, 1, byte);
      EXPECT_NE(Found(Verify({longer})), "ok") << int{byte} << " before byte " << i;
    }
  }
}

TEST_F(AuditVerificationTest, AnyCutIsFoundExceptBetweenLines) {
  const std::string file = SampleLog({4}).front();
  for (size_t size = 0; size < file.size(); ++size) {
    const bool is_between = size > 0 && file[size - 1] == '\n';
    EXPECT_EQ(Found(Verify({file.substr(0, size)})) == "ok", is_between) << size << " bytes";
  }
}

TEST_F(AuditVerificationTest, ACutBetweenLinesIsFoundByACheckpoint) {
  AuditPosition last;
  const std::vector<std::string> lines = LinesOf(SampleLog({4}, SampleKey(), &last).front());
  const std::vector<AuditCheckpoint> checkpoints = {{.number = last.number, .mac = last.mac}};
  EXPECT_EQ(Found(Verify({Joined(lines)}, SampleKey(), checkpoints)), "ok");
  const std::string cut = Joined({lines.begin(), lines.end() - 1});
  EXPECT_EQ(Found(Verify({cut}, SampleKey(), checkpoints)), "cut 3");
}

TEST_F(AuditVerificationTest, WhoHasTheKeyAndWritesAnewIsFoundByACheckpoint) {
  AuditPosition last;
  SampleLog({6}, SampleKey(), &last);
  AuditChain forged(SampleKey(), {});
  std::string file = forged.SealHead("");
  for (int i = 0; i < 5; ++i) file += forged.Seal("\"event\":\"call\",\"resource\":\"other\"");
  EXPECT_EQ(Found(Verify({file})), "ok");
  EXPECT_EQ(Found(Verify({file}, SampleKey(), {{.number = last.number, .mac = last.mac}})),
            "changed 6");
}

TEST_F(AuditVerificationTest, SaysWhereAndHow) {
  using Lines = std::vector<std::string>;
  EXPECT_EQ(
      After([](Lines& lines) { lines[2].replace(lines[2].find("sessions/2"), 10, "sessions/7"); }),
      "changed 3");
  EXPECT_EQ(After([](Lines& lines) { lines[2].replace(5, 1, "9"); }), "changed 3");
  EXPECT_EQ(After([](Lines& lines) { lines.erase(lines.begin() + 2); }), "removed 3");
  EXPECT_EQ(After([](Lines& lines) { lines.erase(lines.begin() + 1, lines.begin() + 4); }),
            "removed 2");
  EXPECT_EQ(After([](Lines& lines) { lines.erase(lines.begin()); }), "removed 1");
  EXPECT_EQ(After([](Lines& lines) { std::swap(lines[2], lines[3]); }), "out of order 3");
  EXPECT_EQ(After([](Lines& lines) { lines.insert(lines.begin() + 3, lines[1]); }), "inserted 4");
  EXPECT_EQ(After([](Lines& lines) { lines.insert(lines.begin() + 3, lines[2]); }), "inserted 4");
  EXPECT_EQ(After([](Lines& lines) { lines.insert(lines.begin() + 2, "nonsense\n"); }),
            "inserted 3");
  EXPECT_EQ(After([](Lines& lines) { lines[4].resize(20); }), "cut 5");
  EXPECT_EQ(After([](Lines& lines) { lines.clear(); }), "cut 0");
}

TEST_F(AuditVerificationTest, AForgedLineIsInserted) {
  std::vector<std::string> lines = LinesOf(SampleLog({5}).front());
  AuditChain forger(SampleKey('x'), {.number = 2});
  lines.insert(lines.begin() + 2, forger.Seal("\"event\":\"call\""));
  EXPECT_EQ(Found(Verify({Joined(lines)})), "inserted 3");
}

TEST_F(AuditVerificationTest, AnotherKeyIsToldApartFromAChange) {
  const std::vector<std::string> files = SampleLog({5});
  EXPECT_EQ(Found(Verify(files, SampleKey('x'))), "wrong key 1");
  std::string changed = files.front();
  changed.replace(changed.find("\"key\":\"") + 7, 1, "z");
  EXPECT_EQ(Found(Verify({changed})), "changed 1") << "the other lines are sealed by the key";
}

TEST_F(AuditVerificationTest, AFileBetweenTwoOthersIsMissed) {
  const std::vector<std::string> files = SampleLog({2, 3, 4});
  EXPECT_EQ(Found(Verify({files[0], files[2]})), "missing file 1");
  EXPECT_EQ(Found(Verify({files[0], files[1], files[1]})), "inserted 1");
}

TEST_F(AuditVerificationTest, TheEndOfAFileBeforeIsMissed) {
  std::vector<std::string> files = SampleLog({3, 2});
  std::vector<std::string> lines = LinesOf(files[0]);
  lines.pop_back();
  files[0] = Joined(lines);
  EXPECT_EQ(Found(Verify(files)), "cut 1");
}

TEST_F(AuditVerificationTest, AnOverlongLineIsNoneAndTakesNoMemory) {
  std::vector<std::string> lines = LinesOf(SampleLog({3}).front());
  lines.insert(lines.begin() + 1, std::string(5 << 20, 'a') + "\n");
  EXPECT_EQ(Found(Verify({Joined(lines)})), "inserted 2");
}

TEST_F(AuditVerificationTest, CheckpointsAreFoundInASystemLog) {
  AuditPosition last;
  SampleLog({2}, SampleKey(), &last);
  const std::string path = testing::WriteFile(
      absl::StrCat(::testing::TempDir(), "syslog"),
      absl::StrCat(
          "Nov 23 17:00:00 host sshd[1]: other\nNov 23 17:00:01 host tissueform-server[7]: ",
          CheckpointText(last), "\ntissueform-audit checkpoint n=x mac=y\n"));
  ASSERT_OK_AND_ASSIGN(const std::vector<AuditCheckpoint> checkpoints, ReadCheckpoints(path));
  ASSERT_EQ(checkpoints.size(), 1);
  EXPECT_EQ(checkpoints.front().number, 2);
  EXPECT_EQ(checkpoints.front().mac, last.mac);
}

TEST_F(AuditVerificationTest, WhatCannotBeReadIsAnError) {
  EXPECT_THAT(VerifyAuditFiles({}, SampleKey()), StatusIs(testing::kInvalid));
  EXPECT_THAT(VerifyAuditFiles({"/none"}, SampleKey()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/none")));
  EXPECT_THAT(VerifyAuditFiles({::testing::TempDir()}, SampleKey()),
              StatusIs(absl::StatusCode::kNotFound));
}

}  // namespace
}  // namespace tissueform
