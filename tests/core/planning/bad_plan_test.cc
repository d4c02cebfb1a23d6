// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <string>

#include "core/base/json/json_text.h"
#include "core/planning/plan_io.h"
#include "tests/core/planning/plan_text.h"
#include "tests/testing/status_matchers.h"

// What is said about a plan that cannot be used: one line, the key, what to do.
namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tissueform::testing::GoodPlan;
using tissueform::testing::IsOk;
using tissueform::testing::Parse;
using tissueform::testing::PlanWith;
using tissueform::testing::PlanWithout;
using tissueform::testing::StatusIs;

absl::StatusOr<Plan> ParseText(const std::string& text) { return ParsePlan(text, "", "plan.json"); }

auto IsRefused(const std::string& why) {
  return StatusIs(absl::StatusCode::kInvalidArgument,
                  AllOf(HasSubstr("plan plan.json: "), HasSubstr(why), Not(HasSubstr("\n"))));
}

TEST(BadPlanTest, UnknownKeyIsNamedWithTheAllowedKeys) {
  EXPECT_THAT(Parse(PlanWith("/modle", "arap")),
              IsRefused("unknown key \"modle\" at /; allowed there: coord"));
  EXPECT_THAT(Parse(PlanWith("/handles/0/pose/scal", 1)),
              IsRefused("unknown key \"scal\" at /handles/0/pose; allowed there: pivot_mm, rot"));
  EXPECT_THAT(Parse(PlanWith("/fixed", {{"vertexes", {1}}})),
              IsRefused("unknown key \"vertexes\" at /fixed"));
  EXPECT_THAT(Parse(PlanWith("/gradient_field", {{"it's", 1}})), IsRefused("unknown key \"it's\""));
}

TEST(BadPlanTest, MissingKeyIsNamed) {
  for (const char* key : {"format", "version", "unit", "coordinate_system", "mesh", "stiffness",
                          "fixed", "handles"}) {
    EXPECT_THAT(Parse(PlanWithout(key)),
                IsRefused("missing key \"" + std::string(key) + "\" at /"));
  }
  EXPECT_THAT(Parse(PlanWith("/handles", {{{"name", "a"}}})),
              IsRefused("missing key \"region\" at /handles/0"));
}

TEST(BadPlanTest, WrongTypeIsNamedWithTheRightOne) {
  EXPECT_THAT(Parse(PlanWith("/poisson_ratio", "0.4")),
              IsRefused("wrong type at /poisson_ratio: \"0.4\" must be a number"));
  EXPECT_THAT(Parse(PlanWith("/fixed", {{"vertices", {1, 2.5}}})),
              IsRefused("wrong type at /fixed/vertices/1: 2.5 must be a whole number"));
  EXPECT_THAT(Parse(PlanWith("/handles/0/pose/pivot_mm", nullptr)),
              IsRefused("wrong type at /handles/0/pose/pivot_mm: null must be an array"));
  EXPECT_THAT(ParseText("[]"), IsRefused("wrong type at /: [] must be an object"));
}

TEST(BadPlanTest, RequiresTheFixedWordsOfTheFormat) {
  EXPECT_THAT(Parse(PlanWith("/version", 5)),
              IsRefused("wrong value at /version: 5 must be 1 to 4"));
  EXPECT_THAT(Parse(PlanWith("/format", "plan")), IsRefused("wrong value at /format"));
  EXPECT_THAT(Parse(PlanWith("/unit", "cm")),
              IsRefused("wrong value at /unit: \"cm\" must be \"mm\""));
  EXPECT_THAT(Parse(PlanWith("/coordinate_system", "LAS")),
              IsRefused("must be \"LPS\" or \"RAS\""));
  EXPECT_THAT(Parse(PlanWith("/model", "spring")),
              IsRefused("\"spring\" must be \"gradient_field\" or"));
}

TEST(BadPlanTest, RefusesInvalidMaterialRanges) {
  const auto with = [](const nlohmann::json& uncertainty) {
    nlohmann::json plan = PlanWith("/uncertainty", uncertainty);
    plan["version"] = 2;
    return Parse(plan);
  };
  EXPECT_THAT(Parse(PlanWith("/uncertainty", {{"youngs_modulus_factor_95", 2}})),
              IsRefused("key \"uncertainty\" at / came with version 2 of the format"));
  EXPECT_THAT(with({{"youngs_modulus_factor_95", 2}}), IsOk());
  EXPECT_THAT(with(nlohmann::json::object()), IsRefused("/uncertainty"));
  for (const double factor : {-2.0, 0.0, 0.5, 11.0}) {
    EXPECT_THAT(with({{"youngs_modulus_factor_95", factor}}),
                IsRefused("/uncertainty/youngs_modulus_factor_95"));
    EXPECT_THAT(with({{"youngs_modulus_factor_95",
                       {{"by_cell_data", "part"}, {"values", {{"1", factor}}}}}}),
                IsRefused("/uncertainty/youngs_modulus_factor_95"));
  }
  EXPECT_THAT(with({{"poisson_ratio_95", {0.4, 0.5}}}),
              IsRefused("/uncertainty/poisson_ratio_95/1: 0.5"));
  EXPECT_THAT(with({{"poisson_ratio_95", {-0.1, 0.4}}}),
              IsRefused("/uncertainty/poisson_ratio_95/0: -0.1"));
  EXPECT_THAT(with({{"poisson_ratio_95", {0.4}}}), IsRefused("/uncertainty/poisson_ratio_95"));
}

TEST(BadPlanTest, NumbersOutOfRangeAreRefused) {
  EXPECT_THAT(Parse(PlanWith("/handles/0/pose/scale", 0)),
              IsRefused("/handles/0/pose/scale: 0, expected"));
  EXPECT_THAT(Parse(PlanWith("/handles/0/pose/scale", -1)), IsRefused("/handles/0/pose/scale: -1"));
  EXPECT_THAT(Parse(PlanWith("/stiffness/uniform", 0)), IsRefused("/stiffness/uniform: 0"));
  EXPECT_THAT(Parse(PlanWith("/stiffness/uniform", -5)), IsRefused("/stiffness/uniform: -5"));
  EXPECT_THAT(Parse(PlanWith("/poisson_ratio", 0.5)), IsRefused("/poisson_ratio: 0.5"));
  EXPECT_THAT(Parse(PlanWith("/poisson_ratio", -0.1)), IsRefused("/poisson_ratio: -0.1"));
  EXPECT_THAT(Parse(PlanWith("/poisson_ratio", 0)), IsOk());
  EXPECT_THAT(Parse(PlanWith("/fixed", {{"vertices", {-1}}})), IsRefused("/fixed/vertices/0: -1"));
  EXPECT_THAT(Parse(PlanWith("/fixed", {{"vertices", {18446744073709551615U}}})),
              IsRefused("/fixed/vertices/0"));
  EXPECT_THAT(Parse(PlanWith("/gradient_field", {{"max_iterations", 0}})),
              IsRefused("max_iterations: 0"));
  EXPECT_THAT(Parse(PlanWith("/gradient_field", {{"tolerance_mm", 0}})),
              IsRefused("tolerance_mm: 0"));
}

TEST(BadPlanTest, ListsOfTheWrongLengthAreRefused) {
  EXPECT_THAT(Parse(PlanWith("/handles/0/pose/translation_mm", {1, 2})),
              IsRefused("translation_mm"));
  EXPECT_THAT(Parse(PlanWith("/handles/0/pose/translation_mm", {1, 2, 3, 4})),
              IsRefused("translation_mm"));
  EXPECT_THAT(Parse(PlanWith("/handles", nlohmann::json::array())), IsRefused("/handles"));
  EXPECT_THAT(Parse(PlanWith("/fixed", {{"union", nlohmann::json::array()}})),
              IsRefused("/fixed/union"));
}

TEST(BadPlanTest, MixedFormsAreRefusedWithTheFormsThatThereAre) {
  EXPECT_THAT(
      Parse(PlanWith("/fixed", {{"vertices", {1}}, {"equals", 2}})),
      IsRefused("wrong combination of keys at /fixed: write one of the forms (which vertices: {"));
  EXPECT_THAT(Parse(PlanWith("/fixed", {{"point_data", "a"}})),
              IsRefused("combination of keys at /fixed"));
  EXPECT_THAT(Parse(PlanWith("/fixed", nlohmann::json::object())),
              IsRefused("combination of keys at /fixed"));
  EXPECT_THAT(Parse(PlanWith("/stiffness/cell_data", "pa")),
              IsRefused("combination of keys at /stiffness"));
}

TEST(BadPlanTest, LabelsOfStiffnessAreWholeNumbers) {
  const auto with_label = [](const std::string& label, double pa) {
    return Parse(PlanWith("/stiffness", {{"by_cell_data", "part"}, {"values", {{label, pa}}}}));
  };
  EXPECT_THAT(with_label("bone", 5), IsRefused("unknown key \"bone\" at /stiffness/values"));
  EXPECT_THAT(with_label("01", 5), IsRefused("unknown key \"01\""));
  EXPECT_THAT(with_label("1", 0), IsRefused("/stiffness/values/1: 0"));
  EXPECT_THAT(with_label("99999999999999999999", 5), IsRefused("99999999999999999999"));
}

TEST(BadPlanTest, InvalidJsonIsRefusedWithItsPlace) {
  EXPECT_THAT(ParseText(""), IsRefused("not valid JSON"));
  EXPECT_THAT(ParseText("{\n  \"unit\": mm}"), IsRefused("line 2"));
  EXPECT_THAT(ParseText(GoodPlan().dump() + "x"), IsRefused("not valid JSON"));
  EXPECT_THAT(ParseText(R"({"poisson_ratio": NaN})"), IsRefused("not valid JSON"));
  EXPECT_THAT(ParseText(R"({"poisson_ratio": Infinity})"), IsRefused("not valid JSON"));
  EXPECT_THAT(ParseText(R"({"poisson_ratio": 1e999})"), IsRefused("not valid JSON"));
  EXPECT_THAT(ParseText(std::string("{\"unit\": \"\xFF\"}")), IsRefused("not valid JSON"));
  EXPECT_THAT(ParseText(std::string("{}\0{}", 5)), IsRefused("not valid JSON"));
}

TEST(BadPlanTest, KeyThatStandsTwiceIsRefused) {
  EXPECT_THAT(ParseText(R"({"unit": "mm", "unit": "cm"})"),
              IsRefused("\"unit\" appears twice at /"));
  EXPECT_THAT(ParseText(R"({"handles": [1, {"pose": {"scale": 1, "scale": 2}}]})"),
              IsRefused("\"scale\" appears twice at /handles/1/pose"));
}

TEST(BadPlanTest, DeepNestingIsRefused) {
  EXPECT_THAT(ParseText(std::string(1000000, '[')), IsRefused("nested deeper"));
  nlohmann::json selector = {{"vertices", {0}}};
  for (size_t depth = 0; depth < kMaxJsonDepth; ++depth) selector = {{"union", {selector}}};
  EXPECT_THAT(Parse(PlanWith("/fixed", selector)), IsRefused("nested deeper"));
}

TEST(BadPlanTest, LongKeyIsRefused) {
  EXPECT_THAT(Parse(PlanWith("/stiffness", {{"by_cell_data", "p"},
                                            {"values", {{std::string(1000000, '1'), 1}}}})),
              IsRefused("a key of 1000000 bytes"));
}

TEST(BadPlanTest, LongValuesDoNotMakeLongLines) {
  const absl::StatusOr<Plan> plan = Parse(PlanWith("/unit", std::string(100000, 'm')));
  ASSERT_THAT(plan, IsRefused("/unit"));
  EXPECT_LT(plan.status().message().size(), 300U);
}

TEST(BadPlanTest, FileThatCannotBeReadIsNamed) {
  EXPECT_THAT(ReadPlan("/missing/plan.json"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("/missing/plan.json")));
  EXPECT_THAT(ReadPlan(::testing::TempDir()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("folder")));
}

TEST(BadPlanTest, HugeFileIsRefused) {
  const std::string path = ::testing::TempDir() + "/huge_plan.json";
  std::ofstream(path) << GoodPlan().dump() << std::string(kMaxPlanBytes, ' ');
  EXPECT_THAT(ReadPlan(path),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("16777216")));
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace tissueform
