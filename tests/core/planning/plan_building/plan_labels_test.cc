// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/plan_labels.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/anatomy/itk_filters.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/plan_building/plan_builder.h"
#include "tests/core/planning/plan_building/coarse_recipe.h"
#include "tests/core/planning/plan_building/plan_comparison.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"
#include "tests/testing/unpacked_archive.h"

// Plans from label maps of the bundled head, which rules make from what thresholds find, as a
// segmentation network would name it: with marrow and teeth.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// DentalSegmentator's numbers.
constexpr uint8_t kSkullLabel = 1;
constexpr uint8_t kMandibleLabel = 2;
constexpr uint8_t kUpperTeethLabel = 3;
constexpr uint8_t kLowerTeethLabel = 4;

constexpr int kThreads = 2;

Recipe RecipeOfHead() {
  Recipe recipe = testing::CoarseRecipe();
  recipe.ct.hu_offset = -1024;
  recipe.ct.axes = "RPI";
  return recipe;
}

std::string BundledCt() { return TestDataPath("ct/headsq/headsq_quarter.nhdr"); }

// A NRRD in LPS; `mirror` and `shift_mm` state a wrong place.
struct Place {
  double shift_mm = 0;  // to the left
  bool mirror = false;  // about the middle of the grid
};

std::string WriteNrrd(const std::string& name, const LabelGrid& labels, const Place& place = {}) {
  const GridGeometry& grid = labels.geometry;
  const std::string path = absl::StrCat(::testing::TempDir(), "/", name, ".nrrd");
  const double width = grid.spacing_mm * (grid.size[0] - 1);
  const double x = grid.origin_mm.x() + place.shift_mm + (place.mirror ? width : 0);
  std::ofstream stream(path, std::ios::binary);
  stream << "NRRD0004\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: "
         << grid.size[0] << " " << grid.size[1] << " " << grid.size[2] << "\nspace directions: ("
         << (place.mirror ? -grid.spacing_mm : grid.spacing_mm) << ",0,0) (0," << grid.spacing_mm
         << ",0) (0,0," << grid.spacing_mm << ")\nspace origin: (" << x << "," << grid.origin_mm.y()
         << "," << grid.origin_mm.z() << ")\nencoding: raw\nendian: little\n\n";
  stream.write(reinterpret_cast<const char*>(labels.values.data()),
               static_cast<std::streamsize>(labels.values.size()));
  return path;
}

LabelGrid Filled(const LabelGrid& labels, uint8_t wanted) {
  return Close(MaskWhere(labels, [wanted](uint8_t label) { return label == wanted; }), 3);
}

// The rules: bone with its marrow; teeth are what is dense as enamel about the occlusal plane.
LabelGrid NamedLabels(const PlanBuild& build) {
  LabelGrid labels(build.head.hu.geometry);
  const LabelGrid skull = Filled(build.parts.labels, kCranium);
  const LabelGrid mandible = Filled(build.parts.labels, kMandible);
  const double incisor_z = build.landmarks.lower_incisor.z();
  const double back_y = build.landmarks.lower_molar.left.y() + 10;
  ForEachVoxel(LabelGrid(labels.geometry, 1), [&](size_t i, const Eigen::Vector3d& place) {
    const bool tooth = build.head.hu.values[i] > 1100 && place.y() < back_y &&
                       std::abs(place.z() - incisor_z) < 14;
    if (skull.values[i] != 0) labels.values[i] = tooth ? kUpperTeethLabel : kSkullLabel;
    if (mandible.values[i] != 0) labels.values[i] = tooth ? kLowerTeethLabel : kMandibleLabel;
  });
  return labels;
}

// Every label grown by a voxel where nothing else is labelled.
LabelGrid Grown(LabelGrid labels) {
  const LabelGrid before = labels;
  for (const uint8_t label : {kSkullLabel, kMandibleLabel, kUpperTeethLabel, kLowerTeethLabel}) {
    const LabelGrid larger =
        Dilate(MaskWhere(before, [label](uint8_t value) { return value == label; }),
               before.geometry.spacing_mm);
    for (size_t i = 0; i < labels.values.size(); ++i) {
      if (labels.values[i] == 0 && larger.values[i] != 0) labels.values[i] = label;
    }
  }
  return labels;
}

LabelGrid Shrunk(const LabelGrid& labels) {
  LabelGrid kept = Erode(MaskWhere(labels, [](uint8_t label) { return label != 0; }),
                         labels.geometry.spacing_mm);
  for (size_t i = 0; i < kept.values.size(); ++i) {
    if (kept.values[i] != 0) kept.values[i] = labels.values[i];
  }
  return kept;
}

absl::StatusOr<PlanBuild> BuildWith(const std::string& labels) {
  Recipe recipe = RecipeOfHead();
  recipe.labels.file = labels;
  return BuildPlan(BundledCt(), recipe, {kThreads, nullptr});
}

class PlanLabelsTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    SetBlasThreads(1);
    absl::StatusOr<PlanBuild> build = BuildPlan(BundledCt(), RecipeOfHead(), {kThreads, nullptr});
    ASSERT_TRUE(build.ok()) << build.status();
    named = std::make_unique<LabelGrid>(NamedLabels(*build));
    truth = std::make_unique<PlanBuild>(*std::move(build));
  }
  static void TearDownTestSuite() {
    truth.reset();
    named.reset();
  }
  void SetUp() override { ASSERT_NE(truth, nullptr); }

  // The face of lips and chin within 0.2 mm of that by thresholds.
  static void ExpectSamePrediction(const std::string& name, const LabelGrid& labels,
                                   double least_dice) {
    ASSERT_OK_AND_ASSIGN(const PlanBuild build, BuildWith(WriteNrrd(name, labels)));
    ASSERT_OK_AND_ASSIGN(const PlanDifference difference,
                         ComparePlans(build, *truth, DeformationModel::kLinearElastic));
    EXPECT_LE(difference.movement_mean_mm, 0.2) << TableRow(name, difference);
    EXPECT_EQ(build.parts.separation, JawSeparation::kLabels);
    const LabelAgreement& agreement = build.labels->agreement;
    ASSERT_EQ(agreement.structures.size(), 2U);
    for (const StructureAgreement& structure : agreement.structures) {
      EXPECT_GE(structure.dice, least_dice) << structure.name;
      EXPECT_LE(structure.dice, least_dice + 0.2) << structure.name;
    }
  }

  static std::unique_ptr<PlanBuild> truth;
  static std::unique_ptr<LabelGrid> named;
};

std::unique_ptr<PlanBuild> PlanLabelsTest::truth;
std::unique_ptr<LabelGrid> PlanLabelsTest::named;

TEST_F(PlanLabelsTest, LabelsOfTheBonePredictTheSameFace) {
  ExpectSamePrediction("same", *named, 0.999);
}

TEST_F(PlanLabelsTest, LabelsThatAreAVoxelTooLargePredictTheSameFace) {
  ExpectSamePrediction("grown", Grown(*named), 0.75);
}

TEST_F(PlanLabelsTest, LabelsThatAreAVoxelTooSmallPredictTheSameFace) {
  ExpectSamePrediction("shrunk", Shrunk(*named), 0.6);
}

TEST_F(PlanLabelsTest, FindsTheSkullWhereOnlyTheLowerJawIsLabelled) {
  LabelGrid jaw = *named;
  for (uint8_t& label : jaw.values) {
    if (label != kMandibleLabel && label != kLowerTeethLabel) label = 0;
  }
  Recipe recipe = RecipeOfHead();
  recipe.labels = {.file = WriteNrrd("jaw", jaw),
                   .names = {{Structure::kLowerJaw, "", kMandibleLabel},
                             {Structure::kLowerTeeth, "", kLowerTeethLabel}},
                   .convention = {}};
  ASSERT_OK_AND_ASSIGN(const PlanLabels labels, CompareWithLabels(BundledCt(), recipe));
  ASSERT_EQ(labels.agreement.structures.size(), 1U);
  EXPECT_GT(labels.agreement.structures[0].dice, 0.999);
  EXPECT_GT(labels.agreement.bone_in_labels, 0.999);
}

TEST_F(PlanLabelsTest, LabelsSeparateJawsThatTheImageDoesNot) {
  Recipe recipe = RecipeOfHead();
  recipe.labels.file = WriteNrrd("same", *named);
  HuGrid ct = truth->head.hu;
  ASSERT_OK_AND_ASSIGN(std::optional<PlanLabels> labels, ReadPlanLabels(recipe, "", 1, &ct));
  HeadSegmentation head = truth->head;
  ASSERT_OK_AND_ASSIGN(const BoneParts parts,
                       SeparateByLabels(absl::InvalidArgumentError("the jaws are one piece"),
                                        recipe.tissues, &head, &*labels));
  EXPECT_EQ(parts.separation, JawSeparation::kLabels);
  const auto jaw = [](const BoneParts& of) {
    return CountVoxels(MaskWhere(of.labels, [](uint8_t part) { return part == kMandible; }));
  };
  EXPECT_NEAR(jaw(parts), jaw(truth->parts), 0.02 * jaw(truth->parts));
}

TEST_F(PlanLabelsTest, MuscleAndFatAreTissuesOfTheTable) {
  LabelGrid soft = *named;
  for (size_t i = 0; i < soft.values.size(); ++i) {
    if (soft.values[i] == 0 && truth->head.head.values[i] != 0) soft.values[i] = 9;
  }
  Recipe recipe = RecipeOfHead();
  recipe.labels = {.file = WriteNrrd("soft", soft),
                   .names = {{Structure::kSkull, "", kSkullLabel}, {Structure::kMuscle, "", 9}},
                   .convention = {}};
  HuGrid ct = truth->head.hu;
  HeadSegmentation head = truth->head;
  ASSERT_OK_AND_ASSIGN(std::optional<PlanLabels> labels, ReadPlanLabels(recipe, "", 1, &ct));
  ASSERT_TRUE(SeparateByLabels(truth->parts, recipe.tissues, &head, &*labels).ok());
  TetStiffnessOptions options{.known_tissue = &labels->tissue};
  ASSERT_OK_AND_ASSIGN(const TetStiffness stiffness,
                       ComputeTetStiffness(truth->mesh.mesh, head.hu, head.bone, options));
  EXPECT_EQ(options.table[1].name, "muscle");
  // All of the soft tissue but what lies in air or bone that were filled.
  EXPECT_GT(stiffness.from_known_tissue, 0.8 * truth->mesh.mesh.num_tets());
  EXPECT_GE(std::ranges::count(stiffness.tissue, 1), stiffness.from_known_tissue);
  EXPECT_EQ(truth->stiffness.from_known_tissue, 0);

  recipe.tissues[1].name = "flesh";
  ASSERT_OK_AND_ASSIGN(labels, ReadPlanLabels(recipe, "", 1, &ct));
  ASSERT_TRUE(SeparateByLabels(truth->parts, recipe.tissues, &head, &*labels).ok());
  EXPECT_TRUE(labels->tissue.values.empty());
  EXPECT_THAT(labels->notes.back(), HasSubstr("no tissue of that name"));
}

absl::Status Outcome(const std::string& labels) {
  Recipe recipe = RecipeOfHead();
  recipe.labels.file = labels;
  return CompareWithLabels(BundledCt(), recipe).status();
}

// The SEG of tests/core/imaging/labels/write_labels.py has a frame of reference that is not the
// CT's; that of the same frame is judged by its place.
TEST_F(PlanLabelsTest, RefusesASegOfAnotherImage) {
  const std::string folder = absl::StrCat(::testing::TempDir(), "/segs");
  std::filesystem::create_directories(folder);
  const std::string command =
      absl::StrCat("/usr/bin/python3 ", SourcePath("tests/core/imaging/labels/write_labels.py"),
                   " ", folder, " 2> ", folder, "/errors.txt");
  ASSERT_EQ(std::system(command.c_str()), 0)
      << "write_labels.py failed; its modules are in deploy/packages.txt";
  Recipe recipe = RecipeOfHead();
  recipe.labels.file = folder + "/binary.dcm";
  HuGrid ct = truth->head.hu;
  EXPECT_THAT(ReadPlanLabels(recipe, "1.2.3", 1, &ct).status(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("its frame of reference is not the CT's")));
  for (const char* const frame_uid : {"1.2.826.0.1.3680043.8.498.1", ""}) {
    EXPECT_THAT(ReadPlanLabels(recipe, frame_uid, 1, &ct).status(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("does not overlap")));
  }
}

TEST_F(PlanLabelsTest, RefusesAShiftedMapAndNamesTheShift) {
  EXPECT_THAT(Outcome(WriteNrrd("shifted", *named, {.shift_mm = 7.5})),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("is shifted"), HasSubstr("moved by (-8, 0, 0) mm"))));
  EXPECT_THAT(Outcome(WriteNrrd("far", *named, {.shift_mm = 60})),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("does not fit the CT")));
}

TEST_F(PlanLabelsTest, RefusesAMirroredMap) {
  EXPECT_THAT(Outcome(WriteNrrd("mirrored", *named, {.mirror = true})),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("is mirrored")));
}

// A map of the same head turned over is as large and lies in the same place.
TEST_F(PlanLabelsTest, RefusesTheMapOfAnotherHead) {
  LabelGrid other = *named;
  std::reverse(other.values.begin(), other.values.end());
  EXPECT_THAT(Outcome(WriteNrrd("other", other)),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("state \"convention\"")));  // its skull lies below its jaw
  Recipe recipe = RecipeOfHead();
  recipe.labels = {
      .file = WriteNrrd("other", other), .names = {}, .convention = "dentalsegmentator"};
  EXPECT_THAT(CompareWithLabels(BundledCt(), recipe).status(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("does not fit the CT"), HasSubstr("of this patient"))));
}

TEST_F(PlanLabelsTest, LabelsOfARealHeadPredictTheSameFaceAndFitNoOtherHead) {
  const std::string archive = SharedDataPath("ct_head_vhm_dicom/vhm_head_dicom.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "the shared data sets are not here";
  const UnpackedArchive files(archive, "'vhm_head/*'");
  ASSERT_TRUE(files.ok());
  const std::string ct = files.Path("vhm_head");
  ASSERT_OK_AND_ASSIGN(const PlanBuild by_thresholds,
                       BuildPlan(ct, testing::CoarseRecipe(), {kThreads, nullptr}));
  const std::string labels = WriteNrrd("vhm", Grown(NamedLabels(by_thresholds)));
  Recipe recipe = testing::CoarseRecipe();
  recipe.labels.file = labels;
  ASSERT_OK_AND_ASSIGN(const PlanBuild build, BuildPlan(ct, recipe, {kThreads, nullptr}));
  ASSERT_OK_AND_ASSIGN(const PlanDifference difference,
                       ComparePlans(build, by_thresholds, DeformationModel::kLinearElastic));
  EXPECT_LE(difference.movement_mean_mm, 0.2) << TableRow("vhm", difference);

  EXPECT_THAT(Outcome(labels),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("does not overlap the CT")));
  // With the chins in one place, as a frame of the scanner's table may have them.
  LabelGrid moved = NamedLabels(by_thresholds);
  moved.geometry.origin_mm += truth->landmarks.menton - by_thresholds.landmarks.menton;
  EXPECT_THAT(Outcome(WriteNrrd("other_patient", moved)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("does not fit the CT")));
}

}  // namespace
}  // namespace tissueform::testing
