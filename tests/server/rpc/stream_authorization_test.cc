// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_authorization.h"

#include <atomic>
#include <chrono>
#include <future>

#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::tissueform::testing::StatusIs;

constexpr std::chrono::milliseconds kPeriod{1};

class StreamAuthorizationTest : public ::testing::Test {
 protected:
  // Returns when everything that was due before has been called.
  void WaitForTimer() {
    std::promise<void> reached;
    timer_.Start(std::chrono::steady_clock::now() + 20 * kPeriod, [&] { reached.set_value(); });
    reached.get_future().wait();
  }

  WorkerPool pool_{1};
  DeadlineTimer timer_;
  std::atomic<int> checks_ = 0;
};

TEST_F(StreamAuthorizationTest, AsksUntilTheCallerMayNotGoOn) {
  std::promise<absl::Status> ended;
  StreamAuthorization authorization(
      &timer_, &pool_, kPeriod,
      [&] {
        const bool expired = ++checks_ == 3;
        return [expired] {
          return expired ? absl::UnauthenticatedError("expired") : absl::OkStatus();
        };
      },
      [&](const absl::Status& status) { ended.set_value(status); });
  authorization.Start();
  EXPECT_THAT(ended.get_future().get(), StatusIs(absl::StatusCode::kUnauthenticated));
  WaitForTimer();
  EXPECT_EQ(checks_, 3);
  authorization.Stop();
}

TEST_F(StreamAuthorizationTest, AsksNothingOnceItHasStopped) {
  StreamAuthorization authorization(
      &timer_, &pool_, kPeriod,
      [&] {
        ++checks_;
        return [] { return absl::OkStatus(); };
      },
      [](const absl::Status& /*status*/) { ADD_FAILURE(); });
  authorization.Start();
  while (checks_ == 0) WaitForTimer();
  authorization.Stop();
  const int checks = checks_;
  WaitForTimer();
  EXPECT_EQ(checks_, checks);
}

TEST_F(StreamAuthorizationTest, StoppingEndsTheWaitForALongPeriod) {
  StreamAuthorization authorization(
      &timer_, &pool_, std::chrono::hours(1), [] { return [] { return absl::OkStatus(); }; },
      [](const absl::Status& /*status*/) {});
  authorization.Stop();  // also before it has started
  authorization.Start();
}

}  // namespace
}  // namespace tissueform
