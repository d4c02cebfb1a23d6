// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "absl/container/flat_hash_map.h"
#include "absl/status/status.h"

#include "core/base/duration_histogram.h"
#include "server/platform/metrics_page.h"
#include "server/rpc/calls/call_observer.h"

namespace tissueform {

// Counts calls: how many ended with which code and for which reason, how long they took, how many
// are open. By rpc and code and nothing that a client sends. Thread-safe, without a lock.
class CallMetrics final : public CallObserver {
 public:
  CallMetrics();

  // Puts all of it on the page, which this must outlive. Once.
  void AddTo(MetricsPage* page) const;

  absl::Status OnBegin(const ObservedCall& call) override;
  void OnResource(const ObservedCall& /*call*/) override {}
  void OnEnd(const ObservedCall& call, const absl::Status& outcome,
             std::chrono::steady_clock::duration elapsed) override;

 private:
  // gRPC's codes, which are Abseil's.
  static constexpr size_t kNumCodes = static_cast<size_t>(absl::StatusCode::kUnauthenticated) + 1;

  struct OfRpc {
    std::array<std::atomic<int64_t>, kNumCodes> ended = {};
    std::atomic<int64_t> open = 0;
    DurationHistogram durations;
  };
  struct OfReason {
    std::atomic<int64_t> all = 0;
    std::atomic<int64_t> unauthenticated = 0;
  };

  void AddCallsTo(const std::string& rpc, const OfRpc& of_rpc, MetricsPage* page) const;
  OfRpc& Of(std::string_view method);

  // Their keys are constant; node addresses, too.
  std::map<std::string, OfRpc> rpcs_;
  std::map<std::string, OfReason, std::less<>> reasons_;
  absl::flat_hash_map<std::string_view, OfRpc*> by_method_;
  OfRpc* other_ = nullptr;
};

}  // namespace tissueform
