// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/access/http_exchange.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;

TEST(CheckLoginUrl, TakesHttpsAndThisMachine) {
  for (const char* url : {"https://login.example.org/realms/clinic", "https://a:8443",
                          "http://localhost:9000", "http://127.0.0.1", "http://[::1]:9000/x"}) {
    EXPECT_TRUE(CheckLoginUrl("--issuer", url).ok()) << url;
  }
}

TEST(CheckLoginUrl, RefusesWhereSecretsWouldBeSeen) {
  for (const std::string& url :
       {std::string("http://login.example.org"), std::string("http://localhost.example.org"),
        std::string("ftp://localhost"), std::string("file:///etc/passwd"), std::string("localhost"),
        std::string("https://"), std::string("https://user:secret@a"),
        std::string("https://a/\x1b[2J"), std::string("https://a b"), std::string(),
        "https://a/" + std::string(3000, 'x')}) {
    const absl::Status status = CheckLoginUrl("--issuer", url);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << url;
    EXPECT_THAT(std::string(status.message()), HasSubstr("--issuer is no URL"));
  }
}

TEST(CurlExchange, SaysWhoCannotBeAskedAndNotWhat) {
  // Port 9 of loopback: nobody listens there.
  const auto answer =
      CurlExchange()({.url = "http://127.0.0.1:9/?secret", .form = {{"code", "secret"}}});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("127.0.0.1 cannot be asked"));
  EXPECT_THAT(std::string(answer.status().message()), ::testing::Not(HasSubstr("secret")));
}

}  // namespace
}  // namespace tissueform
