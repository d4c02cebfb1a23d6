// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/number_options.h"

#include <chrono>
#include <fstream>
#include <set>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Pair;

ServerOptions Parsed(const std::vector<std::string>& words) {
  ServerOptions options;
  CLI::App app;
  AddNumberOptions(app, &options);
  app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  return options;
}

TEST(NumberOptionsTest, AnOptionSetsItsOwnMember) {
  for (const NumberOption& option : NumberOptions()) {
    if (option.name.empty()) continue;
    const ServerOptions defaults;
    const int64_t other =
        option.get(defaults) / option.unit == option.min ? option.min + 1 : option.min;
    const ServerOptions options = Parsed({std::string(option.name), std::to_string(other)});
    for (const NumberOption& each : NumberOptions()) {
      EXPECT_EQ(each.get(options),
                each.limit == option.limit ? other * option.unit : each.get(defaults))
          << option.name << " and " << each.limit;
    }
  }
}

TEST(NumberOptionsTest, UnitsAreThoseOfTheName) {
  const ServerOptions options = Parsed({"--max-mesh-mib", "3", "--session-idle-ttl", "7",
                                        "--max-link-hours", "5", "--drain-seconds", "2"});
  EXPECT_EQ(options.limits.max_mesh_bytes, int64_t{3} << 20);
  EXPECT_EQ(options.limits.session_idle_ttl, std::chrono::seconds(7));
  EXPECT_EQ(options.access.max_link_lifetime, std::chrono::hours(5));
  const NamedLimits limits = LimitsOf(options);
  EXPECT_THAT(limits, Contains(Pair("max_mesh_bytes", int64_t{3} << 20)));
  EXPECT_THAT(limits, Contains(Pair("session_idle_ttl_ms", 7'000)));
  EXPECT_THAT(limits, Contains(Pair("max_link_hours", 5)));
  EXPECT_THAT(limits, Contains(Pair("drain_deadline_ms", 2'000)));
  EXPECT_THAT(limits, Contains(Pair("configuration_deadline_ms", 10'000)));
}

TEST(NumberOptionsTest, AValueOutOfRangeIsRefused) {
  EXPECT_THROW(Parsed({"--max-tets", "0"}), CLI::ValidationError);
  EXPECT_THROW(Parsed({"--retention-days", "36501"}), CLI::ValidationError);
}

TEST(NumberOptionsTest, NamesAreUnique) {
  std::set<std::string> seen;
  for (const NumberOption& option : NumberOptions()) {
    EXPECT_TRUE(seen.insert(std::string(option.limit)).second) << option.limit;
    if (!option.name.empty()) {
      EXPECT_TRUE(seen.insert(std::string(option.name)).second) << option.name;
    }
  }
}

TEST(NumberOptionsTest, MemoryQuotaDefaultsToHalfOfTheBudget) {
  ServerOptions options;
  options.memory_budget_bytes = 100;
  EXPECT_THAT(LimitsOf(options), Contains(Pair("quota_memory_bytes", 50)));
  options.quotas.memory_bytes = 7;
  EXPECT_THAT(LimitsOf(options), Contains(Pair("quota_memory_bytes", 7)));
}

TEST(NumberOptionsTest, TheDocumentHasTheRowsOfTheTable) {
  std::ifstream file(testing::SourcePath("docs/server-options.md"));
  std::stringstream text;
  text << file.rdbuf();
  EXPECT_THAT(text.str(), HasSubstr(NumberOptionRows())) << "write these rows into the document";
}

}  // namespace
}  // namespace tissueform
