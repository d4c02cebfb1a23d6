// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/call_scope.h"

#include <chrono>
#include <thread>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

// A call that is refused or served, and over.
absl::StatusCode AdmissionOf(CallKind kind, ServiceGate* gate) {
  const CallScope scope("Test.Call", kind, gate);
  EXPECT_EQ(scope.End(scope.admission()).ok(), scope.admission().ok());
  return scope.admission().code();
}

TEST(CallScopeTest, ADrainingServerRefusesOnlyNewWork) {
  ServiceGate gate;
  EXPECT_EQ(AdmissionOf(CallKind::kNewWork, &gate), absl::StatusCode::kOk);
  gate.StartDraining();
  EXPECT_EQ(AdmissionOf(CallKind::kNewWork, &gate), absl::StatusCode::kUnavailable);
  EXPECT_EQ(AdmissionOf(CallKind::kUpkeep, &gate), absl::StatusCode::kOk);
}

TEST(CallScopeTest, EndConvertsTheOutcome) {
  ServiceGate gate;
  const CallScope scope("Test.Call", CallKind::kNewWork, &gate);
  EXPECT_EQ(scope.End(absl::NotFoundError("gone")).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST(CallScopeTest, TheGateIsIdleWhenTheLastCallHasEnded) {
  ServiceGate gate;
  const auto at_once = std::chrono::steady_clock::now();
  EXPECT_TRUE(gate.WaitUntilIdle(at_once));
  const CallScope first("Test.First", CallKind::kNewWork, &gate);
  const CallScope second("Test.Second", CallKind::kNewWork, &gate);
  EXPECT_TRUE(first.End(absl::OkStatus()).ok());
  EXPECT_FALSE(gate.WaitUntilIdle(at_once));
  std::thread ends_later([&second] { EXPECT_TRUE(second.End(absl::OkStatus()).ok()); });
  EXPECT_TRUE(gate.WaitUntilIdle(at_once + std::chrono::seconds(30)));
  ends_later.join();
}

}  // namespace
}  // namespace tissueform
