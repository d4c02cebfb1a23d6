// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/metrics_page.h"

#include <limits>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "server/platform/process_metrics.h"
#include "tests/testing/http_get.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::HttpGet;
using testing::IsOk;
using ::testing::Not;
using testing::StatusIs;

TEST(MetricsPageTest, EverythingIsReadWhenItIsAskedFor) {
  double value = 1;
  MetricsPage page;
  page.AddGauge("a_gauge", "A gauge.", {{"place", "here"}}, [&value] { return value; });
  EXPECT_THAT(page.Text(), HasSubstr("a_gauge{place=\"here\"} 1\n"));
  value = 2;
  EXPECT_THAT(page.Text(), HasSubstr("a_gauge{place=\"here\"} 2\n"));
}

TEST(MetricsPageTest, WritesAFamilyOnceWithAllItsLabels) {
  MetricsPage page;
  page.AddCounter("calls_total", "Calls.", {{"rpc", "A"}}, [] { return 1.0; });
  page.AddCounter("others_total", "Others.", {}, [] { return 3.0; });
  page.AddCounter("calls_total", "Not this sentence.", {{"rpc", "B"}}, [] { return 2.0; });
  EXPECT_EQ(page.Text(),
            "# HELP calls_total Calls.\n# TYPE calls_total counter\n"
            "calls_total{rpc=\"A\"} 1\ncalls_total{rpc=\"B\"} 2\n"
            "# HELP others_total Others.\n# TYPE others_total counter\nothers_total 3\n");
}

TEST(MetricsPageTest, OmitsGaugesWithoutAValue) {
  MetricsPage page;
  page.AddGauge("unknown", "Nothing.", {}, [] { return std::numeric_limits<double>::quiet_NaN(); });
  EXPECT_EQ(page.Text(), "");
}

TEST(MetricsPageTest, BucketsAreCumulative) {
  DurationHistogram histogram;
  histogram.Observe(std::chrono::milliseconds(1));
  histogram.Observe(std::chrono::seconds(1000));
  MetricsPage page;
  page.AddHistogram("took_seconds", "How long.", {}, &histogram);
  EXPECT_THAT(page.Text(), AllOf(HasSubstr("took_seconds_bucket{le=\"0.0005\"} 0\n"),
                                 HasSubstr("took_seconds_bucket{le=\"0.001\"} 1\n"),
                                 HasSubstr("took_seconds_bucket{le=\"100\"} 1\n"),
                                 HasSubstr("took_seconds_bucket{le=\"+Inf\"} 2\n"),
                                 HasSubstr("took_seconds_count 2\n")));
}

TEST(MetricsPageTest, ServesTheTextAndNothingElse) {
  MetricsPage page;
  AddProcessMetrics("program", "1.2.3", &page);
  EXPECT_EQ(page.port(), 0);
  ASSERT_THAT(page.Serve(0), IsOk());
  const std::string answer = HttpGet(page.port(), "/metrics");
  EXPECT_THAT(answer,
              AllOf(HasSubstr("200 OK"), HasSubstr("program_build_info{version=\"1.2.3\"} 1"),
                    HasSubstr("process_open_fds "), HasSubstr("process_cpu_seconds_total "),
                    HasSubstr("process_resident_memory_bytes ")));
  EXPECT_THAT(HttpGet(page.port(), "/"), HasSubstr("404"));
  EXPECT_THAT(HttpGet(page.port(), "/../../etc/passwd"), Not(HasSubstr("root:")));
}

TEST(MetricsPageTest, ListensOnLoopbackOnly) {
  MetricsPage page;
  ASSERT_THAT(page.Serve(0), IsOk());
  EXPECT_THAT(HttpGet(page.port(), "/metrics", "127.0.0.1"), HasSubstr("200 OK"));
  EXPECT_EQ(HttpGet(page.port(), "/metrics", "127.0.0.2"), "") << "not the address it listens on";
}

TEST(MetricsPageTest, AnOverlongRequestIsRefusedAndThePageGoesOn) {
  MetricsPage page;
  ASSERT_THAT(page.Serve(0), IsOk());
  EXPECT_THAT(HttpGet(page.port(), "/" + std::string(100'000, 'a')), Not(HasSubstr("200 OK")));
  EXPECT_THAT(HttpGet(page.port(), "/metrics"), HasSubstr("200 OK"));
}

TEST(MetricsPageTest, ATakenPortIsAnError) {
  MetricsPage first;
  ASSERT_THAT(first.Serve(0), IsOk());
  MetricsPage second;
  EXPECT_THAT(second.Serve(first.port()),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("--metrics-port")));
  EXPECT_EQ(second.port(), 0);
}

}  // namespace
}  // namespace tissueform
