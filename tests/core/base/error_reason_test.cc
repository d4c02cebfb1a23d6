// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/error_reason.h"

#include <algorithm>
#include <fstream>
#include <set>
#include <string>

#include "absl/strings/str_split.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;
using ::testing::UnorderedElementsAreArray;

TEST(ErrorReasonTest, AReasonAndItsFactsTravelWithTheStatus) {
  const absl::Status status = WithReason(absl::ResourceExhaustedError("full"),
                                         ErrorReason::kTooManySessions, {{"limit", "6=4"}});
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(status.message(), "full");
  const ErrorInfo info = ErrorInfoOf(absl::Status(status));
  EXPECT_EQ(info.reason, "TOO_MANY_SESSIONS");
  EXPECT_THAT(info.metadata, ElementsAre(Pair("limit", "6=4")));
  EXPECT_TRUE(HasReason(status, ErrorReason::kTooManySessions));
  EXPECT_FALSE(HasReason(status, ErrorReason::kLimitExceeded));
}

TEST(ErrorReasonTest, WithoutOneTheCodeGivesTheReason) {
  EXPECT_EQ(ReasonOf(absl::InvalidArgumentError("")), "INVALID_REQUEST");
  EXPECT_EQ(ReasonOf(absl::AbortedError("")), "CHANGED_MEANWHILE");
  EXPECT_EQ(ReasonOf(absl::UnknownError("")), "INTERNAL_ERROR");
  EXPECT_EQ(ReasonOf(absl::OkStatus()), "");
  EXPECT_TRUE(WithReason(absl::OkStatus(), ErrorReason::kNotFound).ok());
}

TEST(ErrorReasonTest, ReasonsThatThisProgramDoesNotKnowAreKept) {
  const absl::Status status = WithErrorInfo(absl::NotFoundError("no moon"), {"MOON_NOT_FOUND", {}});
  EXPECT_EQ(ReasonOf(status), "MOON_NOT_FOUND");
}

TEST(ErrorReasonTest, NamesAreDistinctAndOfTheFormThatGoogleRpcAsksFor) {
  std::set<absl::string_view> seen;
  for (const absl::string_view name : AllReasonNames()) {
    EXPECT_TRUE(seen.insert(name).second) << name;
    EXPECT_LE(name.size(), 63U);
    EXPECT_EQ(name.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ_"), absl::string_view::npos)
        << name;
  }
}

// The first column of the table of reasons in docs/service-api.md: | `NAME` | ...
std::vector<std::string> ReasonsInTheDocument() {
  std::ifstream file(testing::SourcePath("docs/service-api.md"));
  std::vector<std::string> names;
  bool in_table = false;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("| reason ", 0) == 0) in_table = true;
    if (line.empty()) in_table = false;
    if (in_table && line.rfind("| `", 0) == 0) {
      names.push_back(std::vector<std::string>(absl::StrSplit(line, '`'))[1]);
    }
  }
  return names;
}

TEST(ErrorReasonTest, TheDocumentListsEveryReasonOnce) {
  EXPECT_THAT(ReasonsInTheDocument(), UnorderedElementsAreArray(AllReasonNames()));
}

}  // namespace
}  // namespace tissueform
