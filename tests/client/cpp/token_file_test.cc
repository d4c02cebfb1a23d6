// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/token_file.h"

#include <filesystem>
#include <future>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

using std::filesystem::perms;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class TokenFileTest : public ::testing::Test {
 protected:
  TokenFileTest() { Write("first.token"); }
  ~TokenFileTest() override { std::filesystem::remove_all(folder_); }

  // In place of the one before, as who renews it does.
  void Write(const std::string& token) {
    const std::filesystem::path next = folder_ / "next";
    WriteTestFile(next, token);
    std::filesystem::permissions(next, perms::owner_read | perms::owner_write);
    std::filesystem::last_write_time(
        next, std::filesystem::file_time_type::clock::now() + std::chrono::seconds(++written_));
    std::filesystem::rename(next, path_);
  }

  int written_ = 0;
  const std::filesystem::path folder_ = EmptyTestFolder("token");
  const std::filesystem::path path_ = folder_ / "token";
};

TEST_F(TokenFileTest, IgnoresWhitespaceAroundAToken) {
  Write(" a.b-c_d~e+f/g=\n");
  ASSERT_OK_AND_ASSIGN(const auto file, TokenFile::Open(path_));
  EXPECT_EQ(file->Current(), "a.b-c_d~e+f/g=");
}

TEST_F(TokenFileTest, ARenewedTokenIsRead) {
  ASSERT_OK_AND_ASSIGN(const auto file, TokenFile::Open(path_));
  EXPECT_EQ(file->Current(), "first.token");
  Write("second.token");
  EXPECT_EQ(file->Current(), "second.token");
}

TEST_F(TokenFileTest, InvalidTokenLeavesThePreviousOne) {
  ASSERT_OK_AND_ASSIGN(const auto file, TokenFile::Open(path_));
  for (const char* text : {"", "two words", "\x01"}) {
    Write(text);
    EXPECT_EQ(file->Current(), "first.token") << text;
  }
  std::filesystem::remove(path_);
  EXPECT_EQ(file->Current(), "first.token");
  Write("second.token");
  EXPECT_EQ(file->Current(), "second.token");
}

TEST_F(TokenFileTest, ATokenThatOthersMayOpenIsRefused) {
  for (const perms mode : {perms::group_read, perms::others_read, perms::others_write}) {
    std::filesystem::permissions(path_, perms::owner_read | mode);
    EXPECT_THAT(TokenFile::Open(path_),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("chmod 600")));
  }
}

TEST_F(TokenFileTest, ErrorsHoldNothingOfTheToken) {
  Write("se\tcret");
  EXPECT_THAT(TokenFile::Open(path_),
              StatusIs(kInvalid, AllOf(HasSubstr(path_.string()), Not(HasSubstr("cret")))));
  Write(std::string(kMaxTokenFileBytes + 1, 'a'));
  EXPECT_THAT(TokenFile::Open(path_), StatusIs(kInvalid, Not(HasSubstr("aaaa"))));
  EXPECT_THAT(TokenFile::Open(folder_ / "none"), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(TokenFileTest, LongCallReceivesRenewedToken) {
  ASSERT_OK_AND_ASSIGN(const auto file, TokenFile::Open(path_));
  std::promise<std::string> received;
  TokenRenewal renewal(file, file->Current(),
                       [&received](const std::string& token) { received.set_value(token); });
  Write("second.token");
  EXPECT_EQ(received.get_future().get(), "second.token");
}

}  // namespace
}  // namespace tissueform::testing
