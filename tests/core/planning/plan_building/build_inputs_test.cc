// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/build_inputs.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/imaging/ct/ct_volume_reader.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::BytesOfFile;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::IsOk;
using ::testing::Not;
using testing::StatusIs;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

// The lower face alone, so coarse that it takes seconds.
constexpr char kCoarse[] =
    R"("spacing_mm": 4, "mesh": {"edge_mm": 8, "fine_edge_mm": 8},
       "region_of_interest": {"above": {"point_mm": [0, 0, -50], "normal": [0, 0, -1]},
                              "back": {"point_mm": [0, 100, 0], "normal": [0, -1, 0]}},)";

std::string Recipe(const std::string& further) {
  return absl::StrCat(R"({"format": "tissueform-recipe", "version": 1, )", further,
                      R"("segments": [{"name": "mandible", "osteotomy": "bssro",
                          "pose": {"translation_mm": [0, -4, 0]}}]})");
}

class BuildInputsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    around_ = fs::path(::testing::TempDir()) / "build_inputs_test" / info->name();
    fs::remove_all(around_);
    fs::create_directories(around_ / "inputs");
  }
  void TearDown() override { fs::remove_all(around_); }

  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(around_ / name, std::ios::binary) << text;
  }
  // What is written into the folder "inputs" for recipe.json, in the helper program.
  absl::Status WriteInputs(const std::string& ct, const std::string& labels = "") const {
    return CallPlanBuild({.ct = ct,
                          .recipe = (around_ / "recipe.json").string(),
                          .labels = labels,
                          .only_write_inputs = true,
                          .folder = (around_ / "inputs").string(),
                          .folder_name = "head"})
        .status();
  }
  // The plan of a CT and recipe.json, in a folder of this name.
  void BuildPlan(const std::string& ct, const fs::path& recipe, const std::string& name) const {
    fs::create_directory(around_ / name);
    ASSERT_THAT(CallPlanBuild({.ct = ct,
                               .recipe = recipe.string(),
                               .folder = (around_ / name).string(),
                               .folder_name = "head",
                               .threads = 2,
                               .pictures = false})
                    .status(),
                IsOk());
  }
  std::string AllInputs() const {
    std::string all;
    for (const auto& entry : fs::recursive_directory_iterator(around_ / "inputs")) {
      absl::StrAppend(&all, entry.path().filename().string());
      if (entry.is_regular_file()) all += BytesOfFile(entry.path());
    }
    return all;
  }

  fs::path around_;
};

TEST_F(BuildInputsTest, PlanOfTheInputsIsThatOfTheCtByteForByte) {
  const std::string ct = testing::TestDataPath("ct/headsq/headsq_quarter.nhdr");
  Write("recipe.json",
        Recipe(absl::StrCat(R"("ct": {"hu_offset": -1024, "axes": "RPI"}, )", kCoarse)));
  ASSERT_THAT(WriteInputs(ct), IsOk());
  BuildPlan(ct, around_ / "recipe.json", "here");
  BuildPlan((around_ / "inputs/ct.mha").string(), around_ / "inputs/recipe.json", "there");
  for (const char* file : {"plan.json", "head.vtu", "viewer.glb"}) {
    ASSERT_TRUE(fs::exists(around_ / "here" / file)) << file;
    EXPECT_EQ(BytesOfFile(around_ / "here" / file), BytesOfFile(around_ / "there" / file)) << file;
  }
}

TEST_F(BuildInputsTest, CtOfDicomKeepsItsVolumeAndNothingOfThePatient) {
  testing::CtSeriesOptions series;
  series.axes = Eigen::AngleAxisd(0.2, Eigen::Vector3d(3, 1, 2).normalized()).toRotationMatrix();
  series.origin_mm = {-60.1, 1.0 / 3, 10};
  series.private_text = "Planted";
  fs::create_directory(around_ / "Planted");
  testing::WriteCtSeries(around_ / "Planted", series);
  // Two values alone do not look like HU.
  Write("recipe.json",
        absl::StrReplaceAll(Recipe(R"("ct": {"values": "gray"}, )"), {{": 1,", ": 6,"}}));
  ASSERT_THAT(WriteInputs((around_ / "Planted").string()), IsOk());
  EXPECT_THAT(AllInputs(), AllOf(Not(HasSubstr("lanted")), Not(HasSubstr("PLANTED")),
                                 Not(HasSubstr("4711")), Not(HasSubstr("2026"))));
  CtReadOptions options;
  options.values = CtValues::kGray;
  ASSERT_OK_AND_ASSIGN(const CtVolume here, ReadCtVolume((around_ / "Planted").string(), options));
  ASSERT_OK_AND_ASSIGN(const CtVolume there,
                       ReadCtVolume((around_ / "inputs/ct.mha").string(), options));
  EXPECT_EQ(there.origin_mm, here.origin_mm);
  EXPECT_EQ(there.direction, here.direction);
  EXPECT_EQ(there.spacing_mm, here.spacing_mm);
  EXPECT_EQ(there.hu, here.hu);
}

TEST_F(BuildInputsTest, AFolderOfMasksIsNotSent) {
  fs::create_directory(around_ / "masks of Doe");
  Write("recipe.json", Recipe(""));
  EXPECT_THAT(WriteInputs("ct.nrrd", (around_ / "masks of Doe").string()),
              StatusIs(kInvalid, AllOf(HasSubstr("it is a folder of masks; store it as one .nrrd"),
                                       Not(HasSubstr("Doe")))));
}

TEST_F(BuildInputsTest, FilesThatTheRecipeNamesAreCopiedUnderTheirNames) {
  const std::string json =
      R"({"labels": {"file": "/home/Doe/a.nrrd"}, "landmarks": {"file": "l.mrk.json"},
          "segments": [{"surface": {"file": "pieces/jaw.stl"}, "transform": "t.tfm",
                        "moved": {"file": "pieces/jaw.stl"}}],
          "lips": {"part": true, "mouth_line_file": "m.json"}, "name": "file"})";
  ASSERT_OK_AND_ASSIGN(const std::vector<std::string> files, NamedFiles(json));
  EXPECT_THAT(files, ElementsAre("l.mrk.json", "m.json", "pieces/jaw.stl", "t.tfm"));
  EXPECT_THAT(*NamedFiles("{}"), IsEmpty());
  EXPECT_THAT(NamedFiles("no"), StatusIs(kInvalid, HasSubstr("not JSON")));
  for (const char* path : {"/a.stl", "../a.stl", "a/./b.stl", "a//b.stl", "Doe Jane.stl", ""}) {
    const std::string named =
        absl::StrCat(R"({"segments": [{"surface": {"file": ")", path, "\"}}]}");
    EXPECT_THAT(NamedFiles(named), StatusIs(kInvalid, AllOf(HasSubstr("/segments/0/surface/file"),
                                                            Not(HasSubstr("Doe")))));
  }
}

}  // namespace
}  // namespace tissueform
