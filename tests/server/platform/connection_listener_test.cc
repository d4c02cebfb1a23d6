// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/connection_listener.h"

#include <chrono>
#include <memory>
#include <unistd.h>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include "core/base/mutex.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::StatusIs;

// A connected socket, or -1.
int Connect(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) return fd;
  close(fd);
  return -1;
}

// Whether the other side has closed; waits for what it does, up to 30 s.
bool IsClosedByPeer(int fd) {
  timeval patience{30, 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  char byte = 0;
  return recv(fd, &byte, 1, 0) <= 0;
}

// Holds what it is given, as gRPC does; says a byte so that clients know that they are taken.
class ConnectionListenerTest : public ::testing::Test {
 protected:
  ~ConnectionListenerTest() override {
    listener_.reset();
    CloseAll();
    for (const int fd : clients_) close(fd);
  }

  void Start(int most, int most_of_address) {
    auto listener = ConnectionListener::Listen(
        {.host = "127.0.0.1", .most = most, .most_of_address = most_of_address});
    ASSERT_THAT(listener, testing::IsOk());
    listener_ = *std::move(listener);
    listener_->Start([this](int fd, int /*listener_fd*/) {
      MutexLock lock(mutex_);
      taken_.push_back(fd);
      static_cast<void>(send(fd, "x", 1, MSG_NOSIGNAL) + 0);
    });
  }

  // Whether a new connection is taken; it stays open.
  bool IsTaken() {
    const int fd = Connect(listener_->port());
    if (fd < 0) return false;
    clients_.push_back(fd);
    timeval patience{30, 0};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    char byte = 0;
    return recv(fd, &byte, 1, 0) == 1;
  }

  void CloseAll() {
    MutexLock lock(mutex_);
    for (const int fd : taken_) close(fd);
    taken_.clear();
  }

  std::unique_ptr<ConnectionListener> listener_;
  std::vector<int> clients_;
  Mutex mutex_;
  std::vector<int> taken_ ABSL_GUARDED_BY(mutex_);
};

TEST_F(ConnectionListenerTest, RefusesExcessConnectionsUntilThereIsRoom) {
  Start(20, 20);
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(IsTaken()) << i;
  for (int i = 0; i < 100; ++i) ASSERT_FALSE(IsTaken()) << i;
  CloseAll();
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(IsTaken()) << i;
  EXPECT_FALSE(IsTaken());
}

TEST_F(ConnectionListenerTest, SetsNoDelayOnConnections) {
  Start(1, 1);
  ASSERT_TRUE(IsTaken());
  MutexLock lock(mutex_);
  int no_delay = 0;
  socklen_t size = sizeof(no_delay);
  ASSERT_EQ(getsockopt(taken_.front(), IPPROTO_TCP, TCP_NODELAY, &no_delay, &size), 0);
  EXPECT_NE(no_delay, 0);
}

TEST_F(ConnectionListenerTest, OneAddressDoesNotTakeAllPlaces) {
  Start(20, 3);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(IsTaken());
  EXPECT_FALSE(IsTaken());
}

TEST_F(ConnectionListenerTest, GoesOnAfterTheProcessRanOutOfDescriptors) {
  Start(1000, 1000);
  rlimit before{};
  getrlimit(RLIMIT_NOFILE, &before);
  // The numbers of files that are open stay below; both ends are in this process.
  const int lowest_free = dup(STDERR_FILENO);
  close(lowest_free);
  rlimit low = before;
  low.rlim_cur = static_cast<rlim_t>(lowest_free) + 8;
  setrlimit(RLIMIT_NOFILE, &low);
  int made = 0;
  // The last ones take the descriptors of those who would be accepted.
  std::vector<int> held;
  for (int fd = 0; fd >= 0;) {
    fd = socket(AF_INET, SOCK_STREAM, 0);
    if (fd >= 0) held.push_back(fd);
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(listener_->port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  for (const int fd : held) {
    made += connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 ? 1 : 0;
  }
  EXPECT_EQ(made, static_cast<int>(held.size())) << "the kernel completes them";
  for (const int fd : held) EXPECT_TRUE(IsClosedByPeer(fd)) << "turned away, not left waiting";
  for (const int fd : held) close(fd);
  setrlimit(RLIMIT_NOFILE, &before);
  // The first may come while the thread still has to do with the last that it turned away.
  EXPECT_TRUE(IsTaken() || IsTaken());
}

TEST_F(ConnectionListenerTest, AfterStopThePortIsFree) {
  Start(20, 20);
  const int port = listener_->port();
  listener_->Stop();
  listener_->Stop();  // does no harm
  EXPECT_EQ(Connect(port), -1);
  EXPECT_THAT(ConnectionListener::Listen({.host = "127.0.0.1", .port = port}), testing::IsOk());
}

TEST_F(ConnectionListenerTest, APortThatIsTakenIsRefusedByName) {
  Start(20, 20);
  EXPECT_THAT(ConnectionListener::Listen({.host = "127.0.0.1", .port = listener_->port()}),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("--port")));
  EXPECT_THAT(ConnectionListener::Listen({.host = "no such host"}),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("no such host")));
}

}  // namespace
}  // namespace tissueform
