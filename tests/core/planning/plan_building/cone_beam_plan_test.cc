// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/plan_building/plan_builder.h"
#include "tests/core/planning/plan_building/coarse_recipe.h"
#include "tests/core/planning/plan_building/plan_comparison.h"
#include "tests/testing/cone_beam.h"
#include "tests/testing/meshes.h"
#include "tests/testing/nrrd_file.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"
#include "tests/testing/unpacked_archive.h"

// Plans from cone-beam CTs that are simulated from helical ones, against the plans of these.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr int kThreads = 2;

// About the front of the lower jaw, so that cheeks and nape are outside.
ConeBeam AboutTheJaws(const Landmarks& landmarks, double radius_mm) {
  const Eigen::Vector3d back = (landmarks.gonion.left + landmarks.gonion.right) / 2;
  ConeBeam beam;
  beam.radius_mm = radius_mm;
  beam.axis_mm = {back.x(), landmarks.nose_tip.y() - 8 + radius_mm};
  beam.low_z_mm = landmarks.menton.z() - 30;
  beam.high_z_mm = landmarks.nose_tip.z() + 60;
  return beam;
}

absl::StatusOr<PlanBuild> BuildCone(const CtVolume& helical, const ConeBeam& beam,
                                    const Recipe& recipe) {
  const std::string path = absl::StrCat(::testing::TempDir(), "/cone_beam.nrrd");
  TF_RETURN_IF_ERROR(WriteNrrd(path, ConeBeamOf(helical, beam)));
  return BuildPlan(path, recipe, {kThreads, nullptr});
}

Recipe BundledRecipe() {
  Recipe recipe = CoarseRecipe();
  recipe.ct.hu_offset = -1024;
  recipe.ct.axes = "RPI";
  return recipe;
}

std::string BundledCt() { return TestDataPath("ct/headsq/headsq_quarter.nhdr"); }

// The plan of a cylinder 160 mm wide, which cuts off cheeks and nape, predicts lips and chin as
// that of the whole CT.
PlanBuild ExpectSameFace(const std::string& ct, const Recipe& recipe) {
  absl::StatusOr<PlanBuild> truth = BuildPlan(ct, recipe, {kThreads, nullptr});
  EXPECT_TRUE(truth.ok()) << truth.status();
  EXPECT_FALSE(truth->values.gray) << truth->values.reason;
  const absl::StatusOr<CtVolume> helical = ReadCtVolume(ct, recipe.ct);
  EXPECT_TRUE(helical.ok()) << helical.status();
  const ConeBeam beam = AboutTheJaws(truth->landmarks, 80);
  absl::StatusOr<PlanBuild> build = BuildCone(*helical, beam, CoarseRecipe());
  EXPECT_TRUE(build.ok()) << build.status();
  const absl::StatusOr<PlanDifference> difference =
      ComparePlans(*build, *truth, DeformationModel::kLinearElastic);
  EXPECT_TRUE(difference.ok()) << difference.status();
  EXPECT_LE(difference->movement_mean_mm, 0.3) << TableRow("cone beam", *difference);
  return *std::move(build);
}

TEST(ConeBeamPlanTest, PredictsTheFaceOfTheWholeCt) {
  SetBlasThreads(1);
  const PlanBuild build = ExpectSameFace(BundledCt(), BundledRecipe());
  EXPECT_TRUE(build.values.gray);
  ASSERT_TRUE(build.values.field.has_value());
  EXPECT_NEAR(build.values.field->radius_mm, 80, 2.5 * 3.2);
  EXPECT_EQ(build.values.field->outside_value, 0);
  EXPECT_EQ(build.head.options.bone_above_hu, build.values.bone_above_hu);
  EXPECT_GT(build.coverage.cuts.size(), 1U);
  // One tissue, regardless of the gray values.
  EXPECT_EQ(std::set<int32_t>(build.stiffness.tissue.begin(), build.stiffness.tissue.end()).size(),
            1U);
}

TEST(ConeBeamPlanTest, PredictsTheFaceOfARealHead) {
  const std::string archive = SharedDataPath("ct_head_vhm_dicom/vhm_head_dicom.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "the shared data sets are not here";
  SetBlasThreads(1);
  const UnpackedArchive files(archive, "'vhm_head/*'");
  ASSERT_TRUE(files.ok());
  EXPECT_TRUE(ExpectSameFace(files.Path("vhm_head"), CoarseRecipe()).values.gray);
}

class BadConeBeamTest : public ::testing::Test {
 protected:
  // The error of a plan from the bundled head with this done to it.
  static absl::Status Outcome(const std::function<void(ConeBeam*, CtVolume*)>& change) {
    TF_ASSIGN_OR_RETURN(CtVolume helical, ReadCtVolume(BundledCt(), BundledRecipe().ct));
    ConeBeam beam;
    beam.radius_mm = 90;
    beam.axis_mm = {-98, 100};
    change(&beam, &helical);
    return BuildCone(helical, beam, CoarseRecipe()).status();
  }
};

TEST_F(BadConeBeamTest, ReportsMissingBone) {
  EXPECT_THAT(Outcome([](ConeBeam* beam, CtVolume* helical) {
                beam->noise_hu = 20;
                for (int16_t& hu : helical->hu) hu = std::min(hu, int16_t{60});
              }),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("do not show air, soft tissue and bone")));
}

TEST_F(BadConeBeamTest, UpperJawAloneReportsTheMissingJaw) {
  EXPECT_THAT(Outcome([](ConeBeam* beam, CtVolume*) { beam->low_z_mm = -85; }),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("jaw")));
}

TEST_F(BadConeBeamTest, VolumeOfAFewTeethIsRefused) {
  EXPECT_THAT(Outcome([](ConeBeam* beam, CtVolume*) {
                beam->radius_mm = 35;
                beam->axis_mm = {-98, 60};
                beam->low_z_mm = -140;
                beam->high_z_mm = -60;
              }),
              StatusIs(absl::StatusCode::kInvalidArgument, ::testing::Not(HasSubstr("metal"))));
}

}  // namespace
}  // namespace tissueform::testing
