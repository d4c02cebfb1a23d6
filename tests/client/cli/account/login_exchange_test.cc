// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/login_exchange.h"

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/one_answer.h"

namespace tissueform {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using testing::OneAnswer;

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
    EXPECT_THAT(std::string(status.message()), HasSubstr("--issuer is not a login URL"));
  }
}

TEST(AskProvider, ConnectionErrorNamesTheHostButNotTheUrl) {
  // Port 9 of loopback: no process listens there.
  const auto answer =
      AskProvider({.url = "http://127.0.0.1:9/?secret", .form = {{"code", "secret"}}});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("127.0.0.1 cannot be reached"));
  EXPECT_THAT(std::string(answer.status().message()), ::testing::Not(HasSubstr("secret")));
}

TEST(AskProvider, RefusesAnAnswerAboveTheSizeLimit) {
  const std::string head = "HTTP/1.1 200 OK\r\n\r\n";
  OneAnswer fits(head + std::string(200 << 10, 'x'));
  EXPECT_EQ(AskProvider({.url = fits.url()})->body.size(), size_t{200} << 10);
  fits.Request();
  OneAnswer large(head + std::string(300 << 10, 'x'));
  const absl::Status status = AskProvider({.url = large.url()}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), HasSubstr("the answer is larger than 262144 bytes"));
  large.Request();
}

TEST(AskProvider, EscapesFormValues) {
  OneAnswer server("HTTP/1.1 400 Bad Request\r\ncontent-length: 2\r\n\r\n{}", "c=%C3%A4");
  const auto answer = AskProvider({.url = server.url(), .form = {{"a", "1&b=2"}, {"c", "ä"}}});
  EXPECT_EQ(answer->status, 400);
  EXPECT_THAT(server.Request(), EndsWith("\r\n\r\na=1%26b%3D2&c=%C3%A4"));
}

}  // namespace
}  // namespace tissueform
