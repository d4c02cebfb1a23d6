// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/case_conversion.h"

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::kInvalid;
using ::tissueform::testing::StatusIs;

TEST(CaseNameTest, RoundTrips) {
  const std::string sha256(64, 'a');
  EXPECT_EQ(CaseName(sha256), "cases/" + sha256);
  EXPECT_EQ(*ParseCaseName(CaseName(sha256)), sha256);
}

TEST(CaseNameTest, RefusesOtherNames) {
  for (const std::string& name :
       {std::string(), std::string("cases/"), std::string(64, 'a'), "cases/" + std::string(64, 'A'),
        "cases/" + std::string(63, 'a'), "meshes/" + std::string(64, 'a'),
        std::string("cases/../../etc/passwd")}) {
    EXPECT_THAT(ParseCaseName(name), StatusIs(kInvalid)) << name;
  }
}

TEST(TitleTest, IsTextOfSomeLength) {
  EXPECT_THAT(CheckTitle("", 8), IsOk());
  EXPECT_THAT(CheckTitle("12345678", 8), IsOk());
  EXPECT_THAT(CheckTitle("\xc3\xbc\xe2\x80\x93\xc2\xa0", 8), IsOk()) << "letters of all languages";
  EXPECT_THAT(CheckTitle("123456789", 8), StatusIs(kInvalid, HasSubstr("9 bytes")));
}

TEST(TitleTest, RefusesControlCharacters) {
  for (const char* title : {"a\nDoe", "\x1b[2J Doe", "Doe\x7f", "Doe \xc2\x9b 2J"}) {
    EXPECT_THAT(CheckTitle(title, 256),
                StatusIs(kInvalid, AllOf(HasSubstr("control character"), Not(HasSubstr("Doe")))));
  }
}

}  // namespace
}  // namespace tissueform
