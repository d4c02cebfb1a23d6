// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/server_channel.h"

#include <filesystem>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr absl::StatusCode kRefused = absl::StatusCode::kFailedPrecondition;

class ServerChannelTest : public ::testing::Test {
 protected:
  ServerChannelTest() {
    WriteTestFile(folder_ / "token", "a.b.c");
    std::filesystem::permissions(folder_ / "token", std::filesystem::perms::owner_read);
  }
  ~ServerChannelTest() override { std::filesystem::remove_all(folder_); }

  absl::Status Make(const std::string& address, const ConnectionOptions& options) const {
    auto token = OpenTokenOf(options);
    if (!token.ok()) return token.status();
    return MakeServerChannel(address, options, *token, {}).status();
  }

  const std::filesystem::path folder_ = EmptyTestFolder("channel");
  const std::string token_ = folder_ / "token";
};

TEST_F(ServerChannelTest, RecognizesAddressesOfThisMachine) {
  for (const char* own : {"localhost:1", "127.0.0.1:1", "127.1.2.3:1", "[::1]:1", "unix:/a"}) {
    EXPECT_TRUE(IsLocalAddress(own)) << own;
  }
  for (const char* other :
       {"127.0.0.1.example.org:1", "example.org:1", "192.0.2.1:1", "[::2]:1", "localhost.a:1",
        "127.0.0.256:1", "dns:///127.0.0.1:1", "", "127.0.0:1"}) {
    EXPECT_FALSE(IsLocalAddress(other)) << other;
  }
}

TEST_F(ServerChannelTest, ATokenNeverLeavesTheMachineUnencrypted) {
  const std::string other = "planner.example.org:50051";
  EXPECT_THAT(Make(other, {.token_file = token_}), StatusIs(kRefused, HasSubstr("unencrypted")));
  EXPECT_THAT(Make(other, {.token_file = token_, .insecure = true}),
              StatusIs(kRefused, HasSubstr("unencrypted")));
  EXPECT_THAT(Make(other, {.tls = true, .token_file = token_}), IsOk());
  EXPECT_THAT(Make("127.0.0.1:1", {.token_file = token_}), IsOk());
}

TEST_F(ServerChannelTest, RemoteServerNeedsTlsUnlessInsecureIsGiven) {
  EXPECT_THAT(Make("192.0.2.1:1", {}), StatusIs(kRefused, HasSubstr("--tls")));
  EXPECT_THAT(Make("192.0.2.1:1", {.insecure = true}), IsOk());
  EXPECT_THAT(Make("192.0.2.1:1", {.tls = true}), IsOk());
}

// A reason that is true, and no advice to send anything unencrypted.
TEST_F(ServerChannelTest, AUrlIsNotAnAddress) {
  for (const char* url : {"http://127.0.0.1:1", "https://example.org:1"}) {
    EXPECT_THAT(Make(url, {}), StatusIs(kInvalid, HasSubstr("give HOST:PORT"))) << url;
    EXPECT_THAT(Make(url, {.tls = true}), StatusIs(kInvalid, HasSubstr("give HOST:PORT"))) << url;
  }
}

TEST_F(ServerChannelTest, FilesAreCheckedBeforeAnythingIsSent) {
  const TestAuthority authority;
  const TestFiles files = authority.IssueFiles(folder_, "client");
  const TestFiles others = authority.IssueFiles(folder_, "other");
  EXPECT_THAT(
      Make("a:1",
           {.tls_ca = files.roots, .tls_certificate = files.certificate, .tls_key = files.key}),
      IsOk());
  EXPECT_THAT(Make("a:1", {.tls_ca = files.key}), StatusIs(kInvalid, HasSubstr(files.key)));
  EXPECT_THAT(Make("a:1", {.tls_ca = folder_ / "none"}), StatusIs(absl::StatusCode::kNotFound));
  EXPECT_THAT(Make("a:1", {.tls_certificate = files.certificate}), StatusIs(kInvalid));
  EXPECT_THAT(Make("a:1", {.tls_certificate = files.certificate, .tls_key = others.key}),
              StatusIs(kInvalid, HasSubstr("does not belong")));
}

}  // namespace
}  // namespace tissueform::testing
