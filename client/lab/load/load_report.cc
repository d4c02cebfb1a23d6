// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/load_report.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/circumstances.h"
#include "core/base/error_reason.h"
#include "core/base/percentiles.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kPercents[] = {50, 90, 99, 100};
constexpr size_t kErrorsPrinted = 3;

std::vector<double> Rising(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values;
}

double Share(int64_t part, int64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

std::string DragText(const DragLoad& load, double seconds) {
  const double mebibytes = static_cast<double>(load.bytes) / (1 << 20);
  return absl::StrFormat(
      "%-12s %5d  %31s  %31s  %12s  %5.1f %%  %6.0f  %6.1f\n", load.kind, load.drags,
      PercentilesText(load.picture_ages_ms, 1), PercentilesText(load.latencies_ms, 1),
      load.solves_ms.empty() ? "-"
                             : absl::StrFormat("%.2f / %.2f", Percentile(load.solves_ms, 50),
                                               Percentile(load.solves_ms, 99)),
      100 * Share(load.frames, load.poses_sent), static_cast<double>(load.frames) / seconds,
      mebibytes / seconds);
}

}  // namespace

std::string PercentilesText(const std::vector<double>& values, int digits) {
  if (values.empty()) return "-";
  const std::vector<double> rising = Rising(values);
  std::string text;
  for (const double percent : kPercents) {
    const double value = PercentileOfRising(rising, percent);
    absl::StrAppendFormat(&text, "%s%.*f", text.empty() ? "" : " / ", digits, value);
  }
  return text;
}

Json PercentilesJson(const std::vector<double>& values) {
  if (values.empty()) return nullptr;
  const std::vector<double> rising = Rising(values);
  return {{"count", values.size()},
          {"p50", PercentileOfRising(rising, 50)},
          {"p90", PercentileOfRising(rising, 90)},
          {"p99", PercentileOfRising(rising, 99)},
          {"largest", rising.back()}};
}

std::string ErrorsText(const std::vector<absl::Status>& errors) {
  std::string text = absl::StrFormat("errors: %d\n", errors.size());
  for (size_t i = 0; i < std::min(errors.size(), kErrorsPrinted); ++i) {
    absl::StrAppend(&text, "  ", ReasonOf(errors[i]), ": ", errors[i].message(), "\n");
  }
  return text;
}

std::string LoadText(const LoadOptions& options, const LoadResult& result) {
  std::string text = absl::StrFormat(
      "%-12s %5s  %31s  %31s  %12s  %7s  %6s  %6s\n", "drags", "count", "frame age ms 50/90/99/max",
      "latency ms 50/90/99/max", "solve 50/99", "answers", "frames/s", "MiB/s");
  for (const DragLoad& load : result.drags) absl::StrAppend(&text, DragText(load, options.seconds));
  if (options.churn > 0) {
    absl::StrAppendFormat(&text, "churn: %d sessions created, s 50/90/99/max: %s\n",
                          result.session_seconds.size(),
                          PercentilesText(result.session_seconds, 2));
  }
  if (!result.bare_latencies_ms.empty()) {
    const double ratio = Percentile(result.drags.front().latencies_ms, 50) /
                         Percentile(result.bare_latencies_ms, 50);
    absl::StrAppendFormat(
        &text, "gRPC alone, one stream: latency ms 50/90/99/max %s; %s take %.2f times that\n",
        PercentilesText(result.bare_latencies_ms, 2), result.drags.front().kind, ratio);
  }
  return absl::StrCat(text, ErrorsText(result.errors));
}

Json LoadJson(const LoadOptions& options, const LoadResult& result) {
  Json json = CircumstancesJson();
  json["notice"] = "research software, not a medical device";
  json["sessions"] = options.sessions;
  json["poses_per_second"] = options.poses_per_second;
  json["seconds"] = options.seconds;
  json["churn"] = options.churn;
  json["slow_readers"] = options.slow_readers;
  json["slow_ms"] = options.slow_ms;
  json["refining"] = options.refining;
  json["in_phase"] = options.in_phase;
  json["encoding"] = options.int16 ? "int16" : "float32";
  json["preparing_seconds"] = result.preparing_seconds;
  json["drags"] = Json::array();
  for (const DragLoad& load : result.drags) {
    json["drags"].push_back({{"kind", load.kind},
                             {"drags", load.drags},
                             {"poses_sent", load.poses_sent},
                             {"frames", load.frames},
                             {"bytes", load.bytes},
                             {"picture_age_ms", PercentilesJson(load.picture_ages_ms)},
                             {"latency_ms", PercentilesJson(load.latencies_ms)},
                             {"solve_ms", PercentilesJson(load.solves_ms)}});
  }
  json["bare_latency_ms"] = PercentilesJson(result.bare_latencies_ms);
  json["session_seconds"] = PercentilesJson(result.session_seconds);
  json["errors"] = result.errors.size();
  return json;
}

}  // namespace tissueform
