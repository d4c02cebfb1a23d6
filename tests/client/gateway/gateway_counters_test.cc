// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/gateway_counters.h"

#include <set>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(GatewayCounters, EventsThatDidNotOccurAreNotListed) {
  GatewayCounters counters;
  EXPECT_EQ(counters.Text(), "");
  counters.Add(GatewayEvent::kWrongHost);
  counters.Add(GatewayEvent::kRequest);
  counters.Add(GatewayEvent::kWrongHost);
  EXPECT_EQ(counters.Text(), "request=1 wrong_host=2");
  EXPECT_EQ(counters.Count(GatewayEvent::kWrongHost), 2);
}

TEST(GatewayCounters, MetricsPageSeparatesEventsFromRefusals) {
  GatewayCounters counters;
  counters.Add(GatewayEvent::kSocketCall);
  counters.Add(GatewayEvent::kMalformedRequest);
  MetricsPage page;
  AddCounterMetrics(counters, &page);
  EXPECT_THAT(
      page.Text(),
      ::testing::AllOf(
          ::testing::HasSubstr("tissueform_gateway_events_total{event=\"socket_call\"} 1\n"),
          ::testing::HasSubstr(
              "tissueform_gateway_refusals_total{reason=\"malformed_request\"} 1\n"),
          ::testing::HasSubstr("tissueform_gateway_refusals_total{reason=\"client_gone\"} 0\n")));
}

TEST(GatewayCounters, EveryEventHasANameOfItsOwn) {
  std::set<absl::string_view> names;
  const int count = static_cast<int>(GatewayEvent::kLast) + 1;
  for (int i = 0; i < count; ++i) names.insert(GatewayEventName(static_cast<GatewayEvent>(i)));
  EXPECT_EQ(static_cast<int>(names.size()), count);
  EXPECT_EQ(names.count(""), 0U);
  EXPECT_EQ(GatewayEventName(GatewayEvent::kLast), "client_gone");
}

}  // namespace
}  // namespace tissueform
