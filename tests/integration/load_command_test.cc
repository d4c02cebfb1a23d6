// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "tests/integration/served_cli_test.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/test_paths.h"

// `tissueform load` as a real program against a real server. The test does not check
// the times that it measures.
namespace tissueform::testing {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;

class LoadCommandTest : public ServedCliTest {
 protected:
  ProcessResult Load(std::vector<std::string> words) const {
    words.insert(words.begin(), {"load", "--server", server_->address(), "--plan",
                                 SourcePath("tests/data/plans/tongue/plan.json")});
    return Run(words);
  }
};

TEST_F(LoadCommandTest, ReportsWhatItsDragsReceive) {
  const ProcessResult result = Load({"--sessions", "2", "--refining", "1", "--churn", "1",
                                     "--seconds", "1", "--bare", "--json", "load.json"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("errors: 0"));
  const Json json = Json::parse(Read("load.json"));
  EXPECT_EQ(json["errors"], 0);
  ASSERT_EQ(json["drags"].size(), 2U);
  for (const Json& drags : json["drags"]) {
    EXPECT_GT(drags["frames"], 0) << drags["kind"];
    EXPECT_GT(drags["bytes"], drags["frames"]) << drags["kind"];
    EXPECT_EQ(drags["latency_ms"]["count"], drags["frames"]) << drags["kind"];
  }
  // A prepared drag gets one frame a pose, or none when a newer pose came; neo_hookean's gets
  // early ones, too.
  EXPECT_EQ(json["drags"][0]["drags"], 2);
  EXPECT_GE(json["drags"][0]["poses_sent"], json["drags"][0]["frames"]);
  EXPECT_GT(json["bare_latency_ms"]["count"], 0);
  EXPECT_GT(json["session_seconds"]["count"], 0);
}

TEST_F(LoadCommandTest, ReportsTheAnswersOfOneServerWithoutACluster) {
  const ProcessResult result =
      Load({"--cluster", "--sessions", "2", "--followers", "3", "--commit-seconds", "0.3", "--rate",
            "20", "--seconds", "1", "--json", "cluster.json"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("(no name)"));
  const Json json = Json::parse(Read("cluster.json"));
  EXPECT_EQ(json["errors"], 0);
  EXPECT_EQ(json["reattachments"], 0);
  ASSERT_EQ(json["nodes"].size(), 1U);
  const Json& node = json["nodes"][0];
  EXPECT_EQ(node["node"], "");
  EXPECT_EQ(node["drags"], 2);
  EXPECT_GT(node["frames"], 0);
  EXPECT_GT(node["watch_frames"], 0);
  EXPECT_EQ(node["latency_ms"]["count"], node["frames"]);
  // Every pose is answered, replaced by a newer one, or lost; every commit is acknowledged.
  EXPECT_EQ(json["poses_sent"], json["poses_answered"].get<int>() +
                                    json["poses_coalesced"].get<int>() +
                                    json["poses_dropped"].get<int>());
  EXPECT_EQ(json["poses_dropped"], 0);
  EXPECT_EQ(json["commits_sent"], 6);
  EXPECT_EQ(json["commits_acknowledged"], 6);
  EXPECT_EQ(node["commit_ms"]["count"], 6);
}

TEST_F(LoadCommandTest, RefusesInvalidOptions) {
  EXPECT_THAT(Load({"--sessions", "0", "--churn", "0"}), FailsWith(1, HasSubstr("--sessions")));
  EXPECT_THAT(Load({"--sessions", "0", "--churn", "1", "--bare"}),
              FailsWith(1, HasSubstr("--bare")));
  EXPECT_THAT(Load({"--cluster", "--sessions", "0"}), FailsWith(1, HasSubstr("--sessions")));
  EXPECT_THAT(Load({"--cluster", "--churn", "1"}), FailsWith(2, HasSubstr("--churn")));
  EXPECT_THAT(Load({"--followers", "1"}), FailsWith(2, HasSubstr("--cluster")));
  EXPECT_THAT(Load({"--json", "missing/load.json"}), FailsWith(1, HasSubstr("missing/load.json")));
}

}  // namespace
}  // namespace tissueform::testing
