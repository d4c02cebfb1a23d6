// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"

#include "server/platform/metrics_page.h"

namespace tissueform {

// What a gateway counts: what it has done, and why it has refused something.
enum class GatewayEvent {
  // Done.
  kRequest,
  kSocket,
  kWebCall,
  kSocketCall,
  // Refused, or given up.
  kMalformedRequest,
  kHeaderTooLarge,
  kBodyTooLarge,
  kTooSlow,
  kWrongHost,
  kWrongOrigin,
  kNoSuchPath,
  kWrongMethod,
  kWrongContentType,
  kWrongSubprotocol,
  kTooManySockets,
  kNoCallSlot,
  kMethodRefused,
  kMetadataRefused,
  kMalformedFrame,
  kTextFrame,
  kMessageTooLarge,
  kNoStart,
  kStalled,
  kClientGone,
  kLast = kClientGone,
};

// "header_too_large"; names do not change.
absl::string_view GatewayEventName(GatewayEvent event);

// Thread-safe.
class GatewayCounters {
 public:
  void Add(GatewayEvent event) { ++counts_[static_cast<size_t>(event)]; }
  int64_t Count(GatewayEvent event) const { return counts_[static_cast<size_t>(event)]; }
  // Those that are not 0: "request=3 wrong_host=1"; it contains nothing else about a request.
  std::string Text() const;

 private:
  std::array<std::atomic<int64_t>, static_cast<size_t>(GatewayEvent::kLast) + 1> counts_ = {};
};

// What it has done as tissueform_gateway_events_total, the rest as
// tissueform_gateway_refusals_total; `counters` must outlive the page.
void AddCounterMetrics(const GatewayCounters& counters, MetricsPage* page);

}  // namespace tissueform
