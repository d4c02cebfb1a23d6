// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <random>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/mesh/io/triangle_mesh_io.h"
#include "tests/core/planning/outcome/simulated_patient.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

// The bundled head after its planned operation, in another place.
class OutcomeCommandTest : public CliTest {
 protected:
  void WriteOperatedHead() {
    std::mt19937 random(3);
    const PreOperativeHead pre = BundledHead("head");
    const PostOperativeHead post = OperatedHead(
        pre, pre.problem.poses, {.stiffer = 2, .position = RandomMove(&random, 8, 10)}, &random);
    ASSERT_THAT(
        WriteTriangleMesh(Path("skin.stl"), {.mesh = post.skin, .point_data = {}, .cell_data = {}}),
        IsOk());
    ASSERT_THAT(WriteTriangleMesh(Path("bone.stl"),
                                  {.mesh = *post.bone, .point_data = {}, .cell_data = {}}),
                IsOk());
  }

  ProcessResult Outcome(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"outcome",       "--out",   "outcome",
                                          "--no-pictures", "--model", "linear_elastic"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Run(arguments);
  }

  const std::string plan_ = SourcePath("tests/data/plans/head/plan.json");
};

TEST_F(OutcomeCommandTest, WritesAReportOfAnOperatedHead) {
  WriteOperatedHead();
  const ProcessResult result =
      Outcome({"--pre", plan_, "--post", "skin.stl", "--post-bone", "bone.stl"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("registered by the skull"), HasSubstr("mandible")));
  const auto json = nlohmann::json::parse(Read("outcome/outcome.json"));
  EXPECT_EQ(json["format"], "tissueform-outcome");
  EXPECT_NEAR(json["segments"][0]["real"]["forward_mm"].get<double>(), 6, 0.3);
  ASSERT_THAT(json["predictions"], SizeIs(3));
  EXPECT_EQ(json["predictions"][0]["movement"], "real");
  EXPECT_EQ(json["predictions"][2]["model"], "none");
  const auto& face = json["predictions"][0]["regions"].back()["predicted_to_real"];
  EXPECT_LT(face["mean_absolute_mm"].get<double>(), 0.5);
  EXPECT_EQ(SchemaFindings("outcome.schema.json", "outcome/outcome.json"), "");
  const std::string html = Read("outcome/outcome.html");
  EXPECT_THAT(html, AllOf(HasSubstr("not a medical device"), HasSubstr("lower lip"),
                          Not(HasSubstr("skin.stl")), Not(HasSubstr("<img"))));
}

TEST_F(OutcomeCommandTest, AcceptsACaseInPlaceOfItsPlan) {
  WriteOperatedHead();
  ASSERT_EQ(Run({"case", "pack", plan_, "--out", "head.tfcase"}).exit_code, 0);
  const ProcessResult by_case = Outcome({"--pre", "head.tfcase", "--post", "skin.stl"});
  ASSERT_EQ(by_case.exit_code, 0) << by_case.err;
  EXPECT_THAT(by_case.out, HasSubstr("registered by the forehead"));
  EXPECT_EQ(SchemaFindings("outcome.schema.json", "outcome/outcome.json"), "");
}

TEST_F(OutcomeCommandTest, WrongUseLeavesNothing) {
  EXPECT_THAT(Outcome({"--pre", plan_, "--post", "missing.stl"}),
              FailsWith(1, HasSubstr("missing.stl")));
  EXPECT_THAT(Outcome({"--pre", plan_, "--post", "ct", "--post-bone", "bone.stl"}),
              FailsWith(1, HasSubstr("--post-bone")));
  EXPECT_THAT(Outcome({"--pre", SourcePath("tests/data/plans/head_chin/plan.json"), "--post",
                       "missing.stl"}),
              FailsWith(1, HasSubstr("viewer.glb")));
  EXPECT_THAT(Files(), ElementsAre());
}

}  // namespace
}  // namespace tissueform::testing
