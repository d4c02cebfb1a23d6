// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/audit_options.h"

#include <filesystem>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

const AuditProgram kProgram = {.name = "test", .message_id = "test"};

bool Parses(const std::string& target) {
  CLI::App app;
  AuditOptions options;
  AddAuditOptions(app, "the data folder", &options);
  try {
    app.parse({target, "--audit"});  // CLI11 takes a vector from its back
  } catch (const CLI::ParseError& error) {
    EXPECT_THAT(error.what(), HasSubstr("give journal or syslog://HOST:PORT"));
    return false;
  }
  return options.target == target;
}

TEST(AuditOptions, NamesTheJournalOrACollector) {
  for (const char* target :
       {"journal", "syslog://logs.example.org", "syslog://logs.example.org:6515",
        "syslog://192.0.2.1:6514", "syslog://[2001:db8::1]", "syslog://[2001:db8::1]:6514"}) {
    EXPECT_TRUE(Parses(target)) << target;
  }
  for (const char* target : {"audit.jsonl", "syslog", "syslog://", "syslog://:6514", "syslog://a:0",
                             "syslog://a:65536", "syslog://a:b", "syslog://a/b", "syslog://a b",
                             "syslog://[2001:db8::1", "syslog://u@a", "https://a", "Journal"}) {
    EXPECT_FALSE(Parses(target)) << target;
  }
}

TEST(AuditOptions, ACollectorNeedsAFolderForItsBuffer) {
  EXPECT_THAT(OpenAuditSink({.target = "syslog://localhost"}, kProgram, {}, ""),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--audit-buffer")));
  const std::filesystem::path folder = testing::EmptyTestFolder("audit_options_folder");
  EXPECT_THAT(OpenAuditSink({.target = "syslog://localhost"}, kProgram, {}, folder.string()),
              IsOk());
  EXPECT_TRUE(std::filesystem::exists(folder / "audit-buffer.db"));
}

TEST(AuditOptions, FilesOfTlsAreCheckedAtTheStart) {
  const std::filesystem::path folder = testing::EmptyTestFolder("audit_options_tls");
  testing::WriteTestFile(folder / "ca.pem", "no certificate");
  const std::string authorities = (folder / "ca.pem").string();
  EXPECT_THAT(OpenAuditSink({.target = "syslog://localhost", .authorities = authorities}, kProgram,
                            {}, folder.string()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(authorities)));
}

}  // namespace
}  // namespace tissueform
