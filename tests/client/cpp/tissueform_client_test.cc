// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/tissueform_client.h"

#include <cstdlib>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::tissueform::testing::StatusIs;

// A port of this machine that is taken, but on which no process listens.
class SilentPort {
 public:
  SilentPort() : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    if (bind(socket_, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
        getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
      std::abort();
    }
    port_ = ntohs(address.sin_port);
  }
  ~SilentPort() { close(socket_); }
  SilentPort(const SilentPort&) = delete;
  SilentPort& operator=(const SilentPort&) = delete;

  int port() const { return port_; }

 private:
  const int socket_;
  int port_ = 0;
};

TEST(TissueformClientTest, UnreachableServerIsReportedWithAddressAndAdvice) {
  const SilentPort silent;
  TissueformClient::Options options;
  options.connect_deadline = std::chrono::milliseconds(200);
  const std::string address = absl::StrCat("127.0.0.1:", silent.port());
  EXPECT_THAT(TissueformClient::Connect(address, options),
              StatusIs(absl::StatusCode::kUnavailable,
                       AllOf(HasSubstr(address), HasSubstr("0.2 s"), HasSubstr("start one"))));
}

TEST(TissueformClientTest, AnAddressWithoutPortIsRefusedAtOnce) {
  EXPECT_THAT(TissueformClient::Connect("localhost", {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("HOST:PORT")));
}

}  // namespace
}  // namespace tissueform
