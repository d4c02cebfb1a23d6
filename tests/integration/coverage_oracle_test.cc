// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/test_paths.h"

// What `plan build` reports of the CT's skin that its mesh has, against another program that reads
// the same CT and the plan (measure_coverage.py: numpy and VTK).
namespace tissueform::testing {
namespace {

constexpr int kModulesMissing = 77;

// So coarse that some skin is missing. The tolerance stands for two ways of deciding which air is
// outside, on two grids: both find 99.6 %, and 0.05 % lie between them.
constexpr char kRecipe[] = R"({"format": "tissueform-recipe", "version": 1,
    "ct": {"hu_offset": -1024, "axes": "RPI"}, "spacing_mm": 2.5,
    "mesh": {"edge_mm": 10, "fine_edge_mm": 10},
    "region_of_interest": {"above": {"point_mm": [0, 0, -45], "normal": [0, 0, -1]}},
    "segments": [{"name": "mandible", "osteotomy": "bssro", "pose": {"translation_mm": [0, -1, 0]}}]})";
constexpr double kShareTolerance = 0.003;
// The other program leaves out what lies within 30 mm of the breathing tube: some 14 cm2.
constexpr double kLeastArea = 0.88;

class CoverageOracleTest : public CliTest {
 protected:
  // With a ball ("X Y Z RADIUS") as if the mesh had nothing there. Null without the modules.
  nlohmann::json Measure(const std::string& ball = "") const {
    const std::string command =
        absl::StrCat(TISSUEFORM_PYTHON, " ", SourcePath("tests/integration/measure_coverage.py"),
                     " ", TestDataPath("ct/headsq/headsq_quarter.nhdr"), " ", Path("head"), " ",
                     ball, " > ", Path("others.json"));
    const int exit_code = WEXITSTATUS(std::system(command.c_str()));
    if (exit_code == kModulesMissing) return nullptr;
    EXPECT_EQ(exit_code, 0);
    return nlohmann::json::parse(Read("others.json"));
  }
};

TEST_F(CoverageOracleTest, AnotherProgramFindsAsMuchOfTheSkinCovered) {
  Write("recipe.json", kRecipe);
  const ProcessResult built =
      Run({"plan", "build", "--ct", TestDataPath("ct/headsq/headsq_quarter.nhdr"), "--recipe",
           "recipe.json", "--out", "head", "--no-pictures", "--accept-defects"});
  ASSERT_THAT(built, Succeeds());
  const nlohmann::json other = Measure();
  if (other.is_null()) GTEST_SKIP() << "numpy or python3-vtk9 is missing";
  const nlohmann::json ours = nlohmann::json::parse(Read("head/report.json"))["coverage"]["whole"];
  const double share = ours["covered_share"];
  EXPECT_LT(share, 0.9999);
  EXPECT_NEAR(other["share"], share, kShareTolerance);
  EXPECT_LT(other["area_mm2"], ours["area_mm2"]);
  EXPECT_GT(other["area_mm2"].get<double>(), kLeastArea * ours["area_mm2"].get<double>());

  // It would see a nose that is not there.
  EXPECT_LT(Measure("-97 18 -73 15")["share"].get<double>(), share - 5 * kShareTolerance);
}

}  // namespace
}  // namespace tissueform::testing
