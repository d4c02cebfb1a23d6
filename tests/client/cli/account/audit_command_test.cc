// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/audit_samples.h"
#include "tests/testing/run_tissueform.h"

// The audit commands of the real program.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class AuditCommandTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    ASSERT_THAT(Run({"audit", "keygen", "key"}), Succeeds());
    const auto key = AuditKey::Read(Path("key"));
    ASSERT_TRUE(key.ok());
    files_ = SampleLog({4, 5}, *key, &last_);
    Write("audit.jsonl.000001", files_[0]);
    Write("audit.jsonl", files_[1]);
  }

  ProcessResult Verify(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"audit", "verify", "audit.jsonl", "audit.jsonl.000001",
                                          "--key", "key"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }

  std::vector<std::string> files_;
  AuditPosition last_;
};

TEST_F(AuditCommandTest, AGoodLogIsOkAndItsEndIsLeftToCheckpoints) {
  const ProcessResult result = Verify();
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(StartsWith("ok: 9 lines in 2 files, n=1 to n=9\n"),
                                HasSubstr("without --checkpoints")));
  Write("syslog", "Nov 23 17:00:00 host tissueform-server: " + CheckpointText(last_) + "\n");
  EXPECT_EQ(Verify({"--checkpoints", "syslog"}).out,
            "ok: 9 lines in 2 files, n=1 to n=9\ncheckpoints: 1 compared\n");
}

TEST_F(AuditCommandTest, AChangedLineIsNamed) {
  std::string doctored = files_[1];
  doctored.replace(doctored.find("sessions/2"), 10, "sessions/9");
  Write("audit.jsonl", doctored);
  EXPECT_THAT(Verify(), FailsWith(1, HasSubstr("audit.jsonl:3: changed: line n=7 was changed")));
}

TEST_F(AuditCommandTest, ARemovedLineIsNamed) {
  std::vector<std::string> lines = LinesOf(files_[1]);
  lines.erase(lines.begin() + 2);
  Write("audit.jsonl", Joined(lines));
  EXPECT_THAT(Verify(), FailsWith(1, HasSubstr("audit.jsonl:3: removed: line n=7 is missing")));
}

TEST_F(AuditCommandTest, AnEndThatWasCutOffIsToldByACheckpoint) {
  Write("syslog", CheckpointText(last_) + "\n");
  std::vector<std::string> lines = LinesOf(files_[1]);
  lines.resize(3);
  Write("audit.jsonl", Joined(lines));
  EXPECT_THAT(Verify({"--checkpoints", "syslog"}),
              FailsWith(1, HasSubstr("audit.jsonl:3: cut: the log ends with line n=7, but a "
                                     "checkpoint names line n=9")));
}

TEST_F(AuditCommandTest, WrongUseIsToldInALine) {
  EXPECT_THAT(Run({"audit", "keygen", "key"}), FailsWith(1, HasSubstr("name another file")));
  EXPECT_THAT(Run({"audit", "verify", "none", "--key", "key"}), FailsWith(1, HasSubstr("none")));
  EXPECT_THAT(Run({"audit", "verify", "audit.jsonl"}), FailsWith(2, HasSubstr("--key")));
  EXPECT_THAT(Verify({"--checkpoints", "audit.jsonl"}), FailsWith(1, HasSubstr("no checkpoint")));
  ASSERT_THAT(Run({"audit", "keygen", "other"}), Succeeds());
  EXPECT_THAT(Run({"audit", "verify", "audit.jsonl", "--key", "other"}),
              FailsWith(1, HasSubstr("audit.jsonl:1: wrong key")));
}

}  // namespace
}  // namespace tissueform::testing
