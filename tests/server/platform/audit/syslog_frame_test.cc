// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/syslog_frame.h"

#include <string>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

const AuditProgram kProgram = {.name = "tissueform-server", .message_id = "tissueform-call"};

TEST(SyslogFormat, WritesTheHeaderAndTheLengthInBytes) {
  const absl::Time time = absl::FromUnixMillis(1'700'000'000'007);
  const std::string frame = SyslogFormat(kProgram).Frame(12, time, "{\"event\":\"call\"}");
  const std::string message = frame.substr(frame.find(' ') + 1);
  EXPECT_EQ(frame, absl::StrCat(message.size(), " ", message));
  EXPECT_THAT(message, MatchesRegex(absl::StrCat(
                           "<85>1 2023-11-14T22:13:20\\.007Z [!-~]+ tissueform-server ", getpid(),
                           " tissueform-call \\[meta sequenceId=\"12\"\\] \\{.*\\}")));
}

TEST(SyslogFormat, SequenceIdsBeginAgainAfterTheLargest) {
  const SyslogFormat format(kProgram);
  EXPECT_THAT(format.Frame(2147483647, {}, ""), HasSubstr("sequenceId=\"2147483647\""));
  EXPECT_THAT(format.Frame(2147483648, {}, ""), HasSubstr("sequenceId=\"1\""));
}

}  // namespace
}  // namespace tissueform
