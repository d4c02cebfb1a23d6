// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/dicom_web_answers.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr char kUid[] = "2.25.4711";

// A sequence of one object; with a failure reason where that is not 0.
std::string Sequence(const std::string& uid, int reason = 0) {
  return absl::StrCat(
      R"({"vr":"SQ","Value":[{"00081150":{"vr":"UI","Value":["1.2"]},"00081155":{"vr":"UI","Value":[")",
      uid, R"("]})",
      reason == 0 ? "" : absl::StrCat(R"(,"00081197":{"vr":"US","Value":[)", reason, "]}"), "}]}");
}
std::string Answer(const std::string& failed, const std::string& stored) {
  return absl::StrCat(R"({"00081190":{"vr":"UR","Value":["https://pacs/studies/1/instances/)", kUid,
                      R"("]})", failed.empty() ? "" : absl::StrCat(R"(,"00081198":)", failed),
                      stored.empty() ? "" : absl::StrCat(R"(,"00081199":)", stored), "}");
}
const char* const kEmpty = R"({"vr":"SQ"})";

absl::Status StatusOf(const std::string& text, int http_status) {
  return StatusOfStow("p", text, kUid, http_status);
}

TEST(StatusOfStow, IsOkWhereTheObjectIsListedAsStored) {
  EXPECT_THAT(StatusOf(Answer(kEmpty, Sequence(kUid)), 200), IsOk());
  EXPECT_THAT(StatusOf(Answer("", Sequence(kUid)), 200), IsOk());
  EXPECT_THAT(StatusOf(Answer(Sequence("2.25.1", 0x0110), Sequence(kUid)), 200), IsOk());
}

TEST(StatusOfStow, IsOkWhereItIsStoredWithWarnings) {
  std::string warned = Sequence(kUid);
  warned.insert(warned.size() - 3, R"(,"00081196":{"vr":"US","Value":[45056]})");
  EXPECT_THAT(StatusOf(Answer("", warned), 202), IsOk());
}

TEST(StatusOfStow, IsARefusalIfTheObjectIsListedAsFailed) {
  for (const int http_status : {200, 202, 409}) {
    EXPECT_THAT(StatusOf(Answer(Sequence(kUid, 0x0122), kEmpty), http_status),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("0x0122")));
  }
  EXPECT_THAT(StatusOf(Answer(Sequence(kUid, 0x0122), Sequence("2.25.1")), 200),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(kUid)));
}

TEST(StatusOfStow, IsOkForADuplicate) {
  EXPECT_THAT(StatusOf(Answer(Sequence(kUid, 0x0111), ""), 409), IsOk());
  EXPECT_THAT(StatusOf(Answer(Sequence(kUid, 0x0111), kEmpty), 200), IsOk());
}

TEST(StatusOfStow, IsRetryableIfThePacsHasNoRoom) {
  for (const int reason : {0xA700, 0xA7FF}) {
    EXPECT_THAT(StatusOf(Answer(Sequence(kUid, reason), kEmpty), 409),
                StatusIs(absl::StatusCode::kUnavailable, HasSubstr("no room")));
  }
  EXPECT_THAT(StatusOf(Answer(Sequence(kUid, 0xA800), kEmpty), 409),
              StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST(StatusOfStow, IsRetryableIfTheObjectIsNotMentioned) {
  for (const std::string& text :
       {Answer(kEmpty, kEmpty), Answer("", ""), Answer("", Sequence("2.25.1")), std::string(kUid),
        std::string(), std::string(R"({"00081199":"2.25.4711"})")}) {
    EXPECT_THAT(StatusOf(text, 200), StatusIs(absl::StatusCode::kUnavailable, HasSubstr(kUid)))
        << text;
  }
  EXPECT_THAT(StatusOf("", 409), StatusIs(absl::StatusCode::kFailedPrecondition));
  EXPECT_THAT(StatusOf(Answer("", Sequence(kUid)), 409),
              StatusIs(absl::StatusCode::kFailedPrecondition))
      << "all were refused";
}

}  // namespace
}  // namespace tissueform::testing
