// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/token_file.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/stat.h>

namespace tissueform {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class TokenFileTest : public ::testing::Test {
 protected:
  TokenFileTest() { fs::remove_all(folder_); }
  ~TokenFileTest() override { fs::remove_all(folder_); }

  static std::string ReadAll(const fs::path& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  static fs::perms ModeOf(const fs::path& path) { return fs::status(path).permissions(); }

  const fs::path folder_ = fs::path(::testing::TempDir()) /
                           (std::string("token_file_") +
                            ::testing::UnitTest::GetInstance()->current_test_info()->name());
  const std::string path_ = (folder_ / "tissueform" / "token").string();
  const std::string renewal_ = path_ + ".renewal";
  const LoginClient client_ = {
      .issuer = "https://a", .client_id = "tissueform", .audience = "x", .scopes = "openid"};
};

TEST_F(TokenFileTest, IsAccessibleOnlyToItsOwner) {
  const mode_t before = umask(0);
  ASSERT_TRUE(KeepLogin(path_, client_, {.access_token = "one", .refresh_token = "two"}).ok());
  umask(before);
  EXPECT_EQ(ReadAll(path_), "one\n");
  for (const std::string& file : {path_, renewal_}) {
    EXPECT_EQ(ModeOf(file), fs::perms::owner_read | fs::perms::owner_write) << file;
  }
  EXPECT_EQ(ModeOf(folder_ / "tissueform"), fs::perms::owner_all);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "tissueform"), {}), 2);
}

TEST_F(TokenFileTest, ReadsBackASavedLogin) {
  ASSERT_TRUE(KeepLogin(path_, client_, {.access_token = "one", .refresh_token = "two"}).ok());
  const auto login = ReadLogin(path_);
  ASSERT_TRUE(login.ok()) << login.status();
  EXPECT_EQ(login->refresh_token, "two");
  EXPECT_EQ(login->client.issuer, "https://a");
  EXPECT_EQ(login->client.client_id, "tissueform");
  EXPECT_EQ(login->client.audience, "x");
  EXPECT_EQ(login->client.scopes, "openid");
}

TEST_F(TokenFileTest, LoginWithoutRefreshTokenRemovesThePreviousOne) {
  ASSERT_TRUE(KeepLogin(path_, client_, {.access_token = "one", .refresh_token = "two"}).ok());
  ASSERT_TRUE(KeepLogin(path_, client_, {.access_token = "three"}).ok());
  EXPECT_EQ(ReadAll(path_), "three\n");
  EXPECT_EQ(ReadLogin(path_).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(TokenFileTest, RefusesALoginFileThatOthersMayRead) {
  ASSERT_TRUE(KeepLogin(path_, client_, {.access_token = "one", .refresh_token = "two"}).ok());
  fs::permissions(renewal_, fs::perms::group_read, fs::perm_options::add);
  EXPECT_EQ(ReadLogin(path_).status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(TokenFileTest, ReportsADamagedLoginFile) {
  ASSERT_TRUE(KeepLogin(path_, client_, {.access_token = "one", .refresh_token = "two"}).ok());
  for (const std::string& text :
       {std::string(), std::string("{"), std::string("[1]"), std::string(R"({"issuer": 3})"),
        std::string(R"({"issuer": "https://a"})"), std::string(100'000, ' ')}) {
    std::ofstream(renewal_) << text;
    const absl::Status status = ReadLogin(path_).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << text.substr(0, 40);
    EXPECT_THAT(std::string(status.message()), HasSubstr("log in again"));
  }
}

TEST_F(TokenFileTest, LoggingOutLeavesNothing) {
  ASSERT_TRUE(KeepLogin(path_, client_, {.access_token = "one", .refresh_token = "two"}).ok());
  EXPECT_EQ(*RemoveLogin(path_), true);
  EXPECT_FALSE(fs::exists(path_));
  EXPECT_FALSE(fs::exists(renewal_));
  EXPECT_EQ(*RemoveLogin(path_), false);
}

}  // namespace
}  // namespace tissueform
