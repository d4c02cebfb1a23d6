// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/http/http_client.h"

#include <atomic>
#include <chrono>
#include <string>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/one_answer.h"

namespace tissueform {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using testing::ListenOnLoopback;
using ::testing::Not;
using testing::OneAnswer;

constexpr char kHead[] = "HTTP/1.1 200 OK\r\ncontent-type: text/plain\r\n\r\n";
// Port 9 of loopback: nothing listens there.
constexpr char kNobody[] = "http://127.0.0.1:9/?secret";

// Takes connections on loopback and never answers.
class SilentServer {
 public:
  SilentServer() : listener_(ListenOnLoopback(&url_)) {}
  ~SilentServer() { close(listener_); }

  const std::string& url() const { return url_; }

 private:
  std::string url_;  // before the listener, which writes it
  const int listener_;
};

TEST(ReadUrl, RecognizesConfidentialUrls) {
  for (const char* url : {"https://a.example/keys", "HTTPS://a", "http://localhost:9",
                          "http://127.0.0.1", "http://[::1]:9/x"}) {
    ASSERT_TRUE(ReadUrl(url)) << url;
    EXPECT_TRUE(ReadUrl(url)->IsConfidential()) << url;
  }
  for (const char* url :
       {"http://a.example", "http://localhost.example", "http://127.0.0.1.example",
        "http://localhost@a.example/", "ftp://localhost", "file:///etc/passwd"}) {
    ASSERT_TRUE(ReadUrl(url)) << url;
    EXPECT_FALSE(ReadUrl(url)->IsConfidential()) << url;
  }
  for (const char* url : {"", "keys.json", "https://", "https://a:port/"}) {
    EXPECT_FALSE(ReadUrl(url)) << url;
  }
}

TEST(ReadUrl, RecognizesLoginsAndQueries) {
  EXPECT_FALSE(ReadUrl("https://a/b")->has_login);
  EXPECT_FALSE(ReadUrl("https://a/b")->has_query);
  for (const char* url : {"https://user@a", "https://user:secret@a", "https://:secret@a"}) {
    EXPECT_TRUE(ReadUrl(url)->has_login) << url;
    EXPECT_EQ(ReadUrl(url)->host, "a");
  }
  EXPECT_TRUE(ReadUrl("https://a/b?c=d")->has_query);
}

TEST(EncodeForm, EscapesSeparatorsInValues) {
  EXPECT_EQ(EncodeForm({}), "");
  EXPECT_EQ(EncodeForm({{"a", "1&b=2"}, {"c", "ä"}, {"d", ""}}), "a=1%26b%3D2&c=%C3%A4&d=");
}

TEST(SendHttp, ReturnsStatusTypeAndBody) {
  OneAnswer server(absl::StrCat(kHead, "body"));
  const auto answer =
      SendHttp({.url = server.url(), .headers = {"Accept: text/plain"}, .max_body_bytes = 4});
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->status, 200);
  EXPECT_EQ(answer->content_type, "text/plain");
  EXPECT_EQ(answer->body, "body");
  const std::string request = server.Request();
  EXPECT_THAT(request, HasSubstr("GET / HTTP/1.1"));
  EXPECT_THAT(request, HasSubstr("Accept: text/plain"));
}

TEST(SendHttp, PostsABody) {
  const std::string body = std::string("a\0b", 3) + "=end";
  OneAnswer server("HTTP/1.1 400 Bad Request\r\ncontent-length: 2\r\n\r\n{}", "=end");
  const auto answer = SendHttp({.url = server.url(), .body = &body, .max_body_bytes = 9});
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->status, 400);
  EXPECT_EQ(answer->body, "{}");
  EXPECT_THAT(server.Request(), EndsWith("\r\n\r\n" + body));
}

TEST(SendHttp, FollowsNoRedirect) {
  OneAnswer server(
      "HTTP/1.1 302 Found\r\nlocation: http://127.0.0.1:9/\r\ncontent-length: 2\r\n\r\nhi");
  const auto answer = SendHttp({.url = server.url(), .max_body_bytes = 9});
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->status, 302);
  EXPECT_EQ(answer->body, "hi");
  server.Request();
}

TEST(SendHttp, SupportsOnlyHttpUrls) {
  const auto answer = SendHttp({.url = "file:///etc/passwd", .max_body_bytes = 1 << 20});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kUnavailable);
}

TEST(SendHttp, RefusesALargerBody) {
  OneAnswer server(absl::StrCat(kHead, "body"));
  const auto answer = SendHttp({.url = server.url(), .max_body_bytes = 3});
  EXPECT_EQ(answer.status(), absl::OutOfRangeError("the answer is larger than 3 bytes"));
  server.Request();
}

TEST(SendHttp, ASinkTakesTheBodyOrEndsTheExchange) {
  OneAnswer server(absl::StrCat(kHead, "body"));
  std::string taken;
  auto answer = SendHttp({.url = server.url(), .sink = [&](HttpAnswer* head, auto piece) {
                            EXPECT_EQ(head->status, 200);
                            EXPECT_EQ(head->content_type, "text/plain");
                            taken.append(piece.data(), piece.size());
                            return true;
                          }});
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(taken, "body");
  EXPECT_EQ(answer->body, "");
  server.Request();

  OneAnswer other(absl::StrCat(kHead, "body"));
  answer = SendHttp({.url = other.url(), .sink = [](HttpAnswer*, auto) { return false; }});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kCancelled);
  other.Request();
}

TEST(SendHttp, NamesNeitherUrlNorSecretsInErrors) {
  const std::string body = "secret";
  const absl::Status status = SendHttp({.url = kNobody, .body = &body}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("secret")));
}

TEST(SendHttp, EndsInTime) {
  using std::chrono::seconds;
  const SilentServer server;
  EXPECT_EQ(SendHttp({.url = server.url(), .total_time = seconds(1)}).status().code(),
            absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(SendHttp({.url = server.url(), .silence_time = seconds(1)}).status().code(),
            absl::StatusCode::kDeadlineExceeded);
  const std::atomic<bool> stopping = true;
  EXPECT_EQ(SendHttp({.url = server.url(), .stopping = &stopping}).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tissueform
