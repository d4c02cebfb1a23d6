// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "gtest/gtest.h"

#include "client/gateway/gateway.h"
#include "tests/client/gateway/fake_server.h"
#include "tests/client/gateway/raw_client.h"

namespace tissueform::testing {

// A gateway in this process before a fake server, each at a free port of loopback.
class GatewayTest : public ::testing::Test {
 protected:
  GatewayTest() { Restart({}); }
  ~GatewayTest() override { EXPECT_EQ(StatusOf(Ask(port(), "GET /healthz HTTP/1.1")), 200); }

  // A gateway with these limits, this login and this file of deviations in its place.
  void Restart(const GatewayLimits& limits, const LoginConfig& login = {},
               const std::string& deviations = "") {
    gateway_.reset();
    GatewayOptions options;
    options.server = server_.address();
    options.port = 0;
    options.limits = limits;
    options.login = login;
    options.deviations = deviations;
    auto gateway = Gateway::Start(options);
    ASSERT_TRUE(gateway.ok()) << gateway.status();
    gateway_ = *std::move(gateway);
  }

  int port() const { return gateway_->port(); }
  int64_t Count(GatewayEvent event) const { return gateway_->counters().Count(event); }

  // True as soon as the condition holds; false when it does not within a minute.
  static bool Becomes(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::yield();
    }
    return true;
  }

  FakeServer server_;
  std::unique_ptr<Gateway> gateway_;
};

}  // namespace tissueform::testing
