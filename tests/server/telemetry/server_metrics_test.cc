// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/server_metrics.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(SecurityMetricsTest, WithoutTlsAndTokensReportsOnlyWhetherItIsInsecure) {
  MetricsPage page;
  AddSecurityMetrics({.insecure = true}, &page);
  EXPECT_THAT(page.Text(), AllOf(HasSubstr("tissueform_insecure 1\n"), Not(HasSubstr("alarm")),
                                 Not(HasSubstr("certificate")), Not(HasSubstr("token"))));
}

TEST(SecurityMetricsTest, AlarmsEndsAndFailuresHaveTheNamesOfTheRules) {
  MetricsPage page;
  const auto read = [](double value) { return [value] { return value; }; };
  AddSecurityMetrics({.certificate_expires = read(2e9),
                      .certificate_alarm = read(0),
                      .token_keys_alarm = read(1),
                      .revocations_alarm = read(0),
                      .alarms = read(3),
                      .token_failures = {{"expired", read(7)}}},
                     &page);
  EXPECT_THAT(page.Text(),
              AllOf(HasSubstr("tissueform_insecure 0\n"),
                    HasSubstr("tissueform_certificate_expiry_timestamp_seconds"
                              "{certificate=\"server\"} 2000000000\n"),
                    HasSubstr("tissueform_credentials_alarm{kind=\"certificate\"} 0\n"),
                    HasSubstr("tissueform_credentials_alarm{kind=\"token_keys\"} 1\n"),
                    HasSubstr("tissueform_credentials_alarm{kind=\"revocations\"} 0\n"),
                    HasSubstr("tissueform_token_key_alarms_total 3\n"),
                    HasSubstr("tissueform_token_failures_total{reason=\"expired\"} 7\n")));
}

}  // namespace
}  // namespace tissueform
