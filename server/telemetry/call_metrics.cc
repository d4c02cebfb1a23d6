// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/call_metrics.h"

#include <limits>

#include "core/base/error_reason.h"
#include "server/telemetry/rpc_table.h"

namespace tissueform {
namespace {

// What a newer part of the program may say; nothing of ours does.
constexpr char kOther[] = "other";

MetricsPage::Read ReadOf(const std::atomic<int64_t>& count) {
  return [&count] { return static_cast<double>(count); };
}

}  // namespace

CallMetrics::CallMetrics() {
  for (const Rpc& rpc : AllRpcs()) rpcs_.try_emplace(rpc.name);
  other_ = &rpcs_.try_emplace(kOther).first->second;
  for (auto& [name, of_rpc] : rpcs_) by_method_.emplace(name, &of_rpc);
  for (const absl::string_view reason : AllReasonNames()) reasons_.try_emplace(std::string(reason));
  reasons_.try_emplace(kOther);
}

CallMetrics::OfRpc& CallMetrics::Of(std::string_view method) {
  const auto found = by_method_.find(method);
  return found == by_method_.end() ? *other_ : *found->second;
}

absl::Status CallMetrics::OnBegin(const ObservedCall& call) {
  Of(call.method).open.fetch_add(1, std::memory_order_relaxed);
  return absl::OkStatus();
}

void CallMetrics::OnEnd(const ObservedCall& call, const absl::Status& outcome,
                        std::chrono::steady_clock::duration elapsed) {
  OfRpc& of_rpc = Of(call.method);
  if (call.served) of_rpc.open.fetch_sub(1, std::memory_order_relaxed);
  const auto code = static_cast<size_t>(outcome.code());
  of_rpc.ended[code < kNumCodes ? code : static_cast<size_t>(absl::StatusCode::kUnknown)].fetch_add(
      1, std::memory_order_relaxed);
  of_rpc.durations.Observe(elapsed);
  if (outcome.ok()) return;
  const auto found = reasons_.find(ReasonOf(outcome));
  OfReason& of_reason = (found == reasons_.end() ? reasons_.find(kOther) : found)->second;
  of_reason.all.fetch_add(1, std::memory_order_relaxed);
  if (absl::IsUnauthenticated(outcome)) {
    of_reason.unauthenticated.fetch_add(1, std::memory_order_relaxed);
  }
}

void CallMetrics::AddCallsTo(const std::string& rpc, const OfRpc& of_rpc, MetricsPage* page) const {
  for (size_t code = 0; code < kNumCodes; ++code) {
    const std::atomic<int64_t>& count = of_rpc.ended[code];
    // Of most codes there is never one: seventeen lines an rpc would be mostly noughts.
    const double unless_any = code == 0 ? 0 : std::numeric_limits<double>::quiet_NaN();
    page->AddCounter(
        "tissueform_calls_total", "Calls that have ended, by rpc and code.",
        {{"rpc", rpc}, {"code", absl::StatusCodeToString(static_cast<absl::StatusCode>(code))}},
        [&count, unless_any] { return count == 0 ? unless_any : static_cast<double>(count); });
  }
  page->AddGauge("tissueform_calls_open", "Calls under way, by rpc.", {{"rpc", rpc}},
                 ReadOf(of_rpc.open));
  page->AddHistogram("tissueform_call_duration_seconds",
                     "How long calls took, those of streams from opening to close.", {{"rpc", rpc}},
                     &of_rpc.durations);
}

void CallMetrics::AddTo(MetricsPage* page) const {
  for (const auto& [rpc, of_rpc] : rpcs_) AddCallsTo(rpc, of_rpc, page);
  for (const auto& [reason, of_reason] : reasons_) {
    page->AddCounter("tissueform_failures_total", "Calls that have failed, by reason.",
                     {{"reason", reason}}, ReadOf(of_reason.all));
    page->AddCounter("tissueform_authentication_failures_total",
                     "Calls without an authenticated caller, by reason.", {{"reason", reason}},
                     ReadOf(of_reason.unauthenticated));
  }
}

}  // namespace tissueform
