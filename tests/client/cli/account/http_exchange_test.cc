// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/http_exchange.h"

#include <string>
#include <thread>
#include <unistd.h>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace tissueform {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

// Answers one request at a free port of loopback with these bytes.
class OneAnswer {
 public:
  // A request is whole when it ends with `end`.
  explicit OneAnswer(std::string answer, std::string end = "\r\n\r\n")
      : end_(std::move(end)), listener_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    auto* const any = reinterpret_cast<sockaddr*>(&address);
    EXPECT_EQ(bind(listener_, any, size), 0);
    EXPECT_EQ(listen(listener_, 1), 0);
    getsockname(listener_, any, &size);
    url_ = absl::StrCat("http://127.0.0.1:", ntohs(address.sin_port), "/");
    thread_ = std::thread([this, answer = std::move(answer)] { Serve(answer); });
  }
  ~OneAnswer() { EXPECT_FALSE(thread_.joinable()); }

  const std::string& url() const { return url_; }
  // To be called once, when it has answered.
  std::string Request() {
    thread_.join();
    close(listener_);
    return request_;
  }

 private:
  void Serve(const std::string& answer) {
    const int client = accept(listener_, nullptr, nullptr);
    char byte = 0;
    while (!absl::EndsWith(request_, end_) && recv(client, &byte, 1, 0) == 1) request_ += byte;
    send(client, answer.data(), answer.size(), MSG_NOSIGNAL);
    close(client);
  }

  const std::string end_;
  const int listener_;
  std::string url_;
  std::string request_;
  std::thread thread_;
};

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

TEST(CurlExchange, SaysWhoCannotBeAskedAndNotWhat) {
  // Port 9 of loopback: nobody listens there.
  const auto answer =
      CurlExchange()({.url = "http://127.0.0.1:9/?secret", .form = {{"code", "secret"}}});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("127.0.0.1 cannot be reached"));
  EXPECT_THAT(std::string(answer.status().message()), ::testing::Not(HasSubstr("secret")));
}

TEST(CurlExchange, FollowsNobodyElsewhere) {
  OneAnswer server(
      "HTTP/1.1 302 Found\r\nlocation: http://127.0.0.1:9/\r\ncontent-length: 2\r\n\r\nhi");
  const auto answer = CurlExchange()({.url = server.url()});
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->status, 302);
  EXPECT_EQ(answer->body, "hi");
  EXPECT_THAT(server.Request(), HasSubstr("GET / HTTP/1.1"));
}

TEST(CurlExchange, TakesNoMoreThanAnAnswerMayBe) {
  const std::string head = "HTTP/1.1 200 OK\r\n\r\n";
  OneAnswer fits(head + std::string(200 << 10, 'x'));
  EXPECT_EQ(CurlExchange()({.url = fits.url()})->body.size(), size_t{200} << 10);
  fits.Request();
  OneAnswer large(head + std::string(300 << 10, 'x'));
  EXPECT_EQ(CurlExchange()({.url = large.url()}).status().code(), absl::StatusCode::kUnavailable);
  large.Request();
}

TEST(CurlExchange, SendsAFormWhoseValuesStayValues) {
  OneAnswer server("HTTP/1.1 400 Bad Request\r\ncontent-length: 2\r\n\r\n{}", "c=%C3%A4");
  const auto answer = CurlExchange()({.url = server.url(), .form = {{"a", "1&b=2"}, {"c", "ä"}}});
  EXPECT_EQ(answer->status, 400);
  EXPECT_THAT(server.Request(), EndsWith("\r\n\r\na=1%26b%3D2&c=%C3%A4"));
}

}  // namespace
}  // namespace tissueform
