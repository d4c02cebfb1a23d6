// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <thread>
#include <unistd.h>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace tissueform::testing {

// A socket that listens on a free port of loopback. Writes the URL of its root.
inline int ListenOnLoopback(std::string* url) {
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  auto* const any = reinterpret_cast<sockaddr*>(&address);
  EXPECT_EQ(bind(listener, any, size), 0);
  EXPECT_EQ(listen(listener, 1), 0);
  getsockname(listener, any, &size);
  *url = absl::StrCat("http://127.0.0.1:", ntohs(address.sin_port), "/");
  return listener;
}

// An HTTP server on a free port of loopback that answers one request with the bytes it is given.
class OneAnswer {
 public:
  // A request is complete when it ends with `end`.
  explicit OneAnswer(std::string answer, std::string end = "\r\n\r\n")
      : end_(std::move(end)), listener_(ListenOnLoopback(&url_)) {
    thread_ = std::thread([this, answer = std::move(answer)] { Serve(answer); });
  }
  ~OneAnswer() { EXPECT_FALSE(thread_.joinable()); }

  const std::string& url() const { return url_; }
  // To be called once, after the exchange.
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
  std::string url_;  // before the listener, which writes it
  const int listener_;
  std::string request_;
  std::thread thread_;
};

}  // namespace tissueform::testing
