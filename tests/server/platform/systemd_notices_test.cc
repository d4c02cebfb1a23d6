// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/systemd_notices.h"

#include <array>
#include <cstddef>
#include <cstring>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include <sys/socket.h>
#include <sys/un.h>

#include "tests/testing/scoped_environment.h"

namespace tissueform::testing {
namespace {

// systemd's end of the socket.
class SystemdNoticesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    // An abstract name: one that no file of a long path is needed for.
    const std::string name = absl::StrCat("@tissueform-notices-", getpid());
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, name.data() + 1, name.size() - 1);
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    ASSERT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), size), 0);
    variable_ = std::make_unique<ScopedEnvironment>("NOTIFY_SOCKET", name.c_str());
  }
  void TearDown() override { close(socket_); }

  // The next notice; with MSG_DONTWAIT nothing if there is no notice yet.
  std::string NextNotice(int flags = 0) const {
    std::array<char, 200> bytes{};
    const ssize_t size = recv(socket_, bytes.data(), bytes.size(), flags);
    return size < 0 ? "" : std::string(bytes.data(), static_cast<size_t>(size));
  }

  int socket_ = -1;
  std::unique_ptr<ScopedEnvironment> variable_;
};

TEST_F(SystemdNoticesTest, ReportsReadinessAndTheEnd) {
  NotifySystemdReady();
  EXPECT_EQ(NextNotice(), "READY=1");
  NotifySystemdStopping();
  EXPECT_EQ(NextNotice(), "STOPPING=1");
}

TEST_F(SystemdNoticesTest, EveryAnswerNotifiesTheWatchdog) {
  const ScopedEnvironment interval("WATCHDOG_USEC", "4000");
  const SystemdWatchdog watchdog([](const std::function<void()>& answered) { answered(); });
  for (int i = 0; i < 5; ++i) EXPECT_EQ(NextNotice(), "WATCHDOG=1");
}

TEST_F(SystemdNoticesTest, UnresponsiveProgramDoesNotNotifyTheWatchdog) {
  const ScopedEnvironment interval("WATCHDOG_USEC", "4000");
  std::promise<std::function<void()>> first;
  std::promise<void> second;
  int questions = 0;
  {
    const SystemdWatchdog watchdog([&](std::function<void()> answered) {
      if (++questions == 1) first.set_value(std::move(answered));
      if (questions == 2) second.set_value();
    });
    const std::function<void()> answer = first.get_future().get();
    EXPECT_EQ(NextNotice(MSG_DONTWAIT), "");
    answer();
    EXPECT_EQ(NextNotice(), "WATCHDOG=1");
    second.get_future().get();
  }
  EXPECT_EQ(questions, 2) << "one question at a time";
  EXPECT_EQ(NextNotice(MSG_DONTWAIT), "");
}

TEST_F(SystemdNoticesTest, DoesNothingWithoutAWatchdog) {
  const ScopedEnvironment interval("WATCHDOG_USEC", nullptr);
  bool asked = false;
  {
    const SystemdWatchdog watchdog([&asked](const std::function<void()>&) { asked = true; });
  }
  EXPECT_FALSE(asked);
}

}  // namespace
}  // namespace tissueform::testing
