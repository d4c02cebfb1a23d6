// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/server_pool.h"

#include <optional>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/gateway/stable_hash.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

// Nobody listens there; nothing is sent either.
constexpr char kNobody[] = "unix:/nonexistent/tissueform.sock";

TEST(ServerPool, CallsBeyondAllChannelsAreRefusedByName) {
  ServerPool pool({{.address = kNobody}}, {.calls_per_channel = 2, .channels_per_server = 2});
  std::vector<CallSlot> slots;
  for (int i = 0; i < 4; ++i) {
    auto slot = pool.Take("", "");
    ASSERT_TRUE(slot.ok());
    slots.push_back(*std::move(slot));
  }
  EXPECT_THAT(pool.Take("", "").status(),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("4 open calls")));
  slots.pop_back();
  EXPECT_TRUE(pool.Take("", "").ok());
}

TEST(ServerPool, IsNotReadyWithoutServers) {
  const ServerPool pool({{.address = kNobody}}, {});
  EXPECT_FALSE(pool.IsReady());
}

// Gateways of different versions beside each other must agree.
TEST(StableHash, StaysTheSame) {
  EXPECT_EQ(StableHash(""), 0xf52a15e9a9b5e89bULL);
  EXPECT_NE(StableHash("sessions/a\nserver:1"), StableHash("sessions/a\nserver:2"));
}

TEST(StableHash, SpreadsSimilarNamesEvenly) {
  int first = 0;
  for (int i = 0; i < 1000; ++i) {
    const std::string session = "sessions/" + std::to_string(i);
    if (StableHash(session + "\nserver:1") > StableHash(session + "\nserver:2")) ++first;
  }
  EXPECT_GT(first, 400);
  EXPECT_LT(first, 600);
}

}  // namespace
}  // namespace tissueform
