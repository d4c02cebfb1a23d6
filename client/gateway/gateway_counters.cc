// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/gateway_counters.h"

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

constexpr std::array<absl::string_view, static_cast<size_t>(GatewayEvent::kLast) + 1>
    kGatewayEventNames = {
        "request",
        "socket",
        "web_call",
        "socket_call",
        "malformed_request",
        "header_too_large",
        "body_too_large",
        "too_slow",
        "wrong_host",
        "wrong_origin",
        "no_such_path",
        "wrong_method",
        "wrong_content_type",
        "wrong_subprotocol",
        "too_many_sockets",
        "no_call_slot",
        "method_refused",
        "metadata_refused",
        "malformed_frame",
        "text_frame",
        "message_too_large",
        "no_start",
        "stalled",
        "client_gone",
};

}  // namespace

absl::string_view GatewayEventName(GatewayEvent event) {
  return kGatewayEventNames[static_cast<size_t>(event)];
}

std::string GatewayCounters::Text() const {
  std::string text;
  for (size_t i = 0; i < counts_.size(); ++i) {
    if (counts_[i] == 0) continue;
    absl::StrAppend(&text, text.empty() ? "" : " ", kGatewayEventNames[i], "=", counts_[i].load());
  }
  return text;
}

void AddCounterMetrics(const GatewayCounters& counters, MetricsPage* page) {
  for (size_t i = 0; i < kGatewayEventNames.size(); ++i) {
    const auto event = static_cast<GatewayEvent>(i);
    const auto read = [&counters, event] { return static_cast<double>(counters.Count(event)); };
    const std::string name(GatewayEventName(event));
    if (event < GatewayEvent::kMalformedRequest) {
      page->AddCounter("tissueform_gateway_events_total",
                       "Requests, WebSockets and calls received.", {{"event", name}}, read);
    } else {
      page->AddCounter("tissueform_gateway_refusals_total",
                       "Refused or abandoned requests, by reason.", {{"reason", name}}, read);
    }
  }
}

}  // namespace tissueform
