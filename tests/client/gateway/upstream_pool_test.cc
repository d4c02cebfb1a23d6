// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/upstream_pool.h"

#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

// No server listens there; nothing is sent either.
constexpr char kNobody[] = "unix:/nonexistent/tissueform.sock";

TEST(UpstreamPool, CallsBeyondAllChannelsAreRefusedByName) {
  UpstreamPool pool(kNobody, {.calls_per_channel = 2, .channels_per_server = 2});
  std::vector<CallSlot> slots;
  for (int i = 0; i < 4; ++i) {
    auto slot = pool.Take();
    ASSERT_TRUE(slot.ok());
    slots.push_back(*std::move(slot));
  }
  EXPECT_THAT(pool.Take().status(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("4 open calls")));
  slots.pop_back();
  EXPECT_TRUE(pool.Take().ok());
}

TEST(UpstreamPool, IsNotReadyWithoutAServer) {
  const UpstreamPool pool(kNobody, {});
  EXPECT_FALSE(pool.IsReady());
}

}  // namespace
}  // namespace tissueform
