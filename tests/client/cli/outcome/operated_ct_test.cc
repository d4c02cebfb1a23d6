// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Operated heads as CTs, from the file to the comparison. Surfaces of operated heads are compared
// in tests/core/planning/outcome.

#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"

#include "client/cli/outcome/post_operative.h"
#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "core/planning/outcome/outcome.h"
#include "tests/core/planning/outcome/simulated_ct.h"
#include "tests/core/planning/outcome/simulated_patient.h"
#include "tests/testing/cone_beam.h"
#include "tests/testing/meshes.h"
#include "tests/testing/nrrd_file.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using testing::BundledHead;
using testing::ConeBeam;
using testing::ConeBeamOf;
using testing::CtSimulation;
using testing::ExpectErrorsByRegion;
using testing::ExpectMovements;
using testing::MissedPlan;
using testing::OperatedHead;
using testing::PreOperativeHead;
using testing::RandomMove;
using testing::ScanOf;

constexpr int kThreads = 2;

// From the file of a scan on, as the command does it.
absl::StatusOr<Outcome> CompareWith(const PreOperativeHead& pre, const CtVolume& scan) {
  PostOperativeInput input;
  input.scan = absl::StrCat(::testing::TempDir(), "/operated_ct.nrrd");
  input.threads = kThreads;
  TF_RETURN_IF_ERROR(testing::WriteNrrd(input.scan, scan));
  TF_ASSIGN_OR_RETURN(const PostOperativeHead post, ReadPostOperative(input));
  return CompareOutcome(pre.problem, pre.contents, post,
                        {.models = {DeformationModel::kLinearElastic}, .threads = kThreads});
}

// A head after an operation that missed its plan, whose tissue is another law with other stiffness.
class OperatedCtTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { SetBlasThreads(1); }

  OperatedCtTest()
      : pre_(BundledHead("three_segments")),
        real_(MissedPlan(pre_, &random_)),
        position_(RandomMove(&random_, 8, 10)),
        post_(Operated({.stiffer = 3, .noise_mm = 0, .position = position_})) {}

  PostOperativeHead Operated(const testing::Simulation& simulation) {
    return OperatedHead(pre_, real_, simulation, &random_);
  }

  // The skin in the pre-operative coordinates.
  TriangleMesh TrueSkin() const { return Moved(post_.skin, Inverse(position_)); }

  std::mt19937 random_{37};
  PreOperativeHead pre_;
  std::vector<HandlePose> real_;
  RigidMove position_;
  PostOperativeHead post_;
};

TEST_F(OperatedCtTest, ToleratesMetalPlatesAndTheirStreaks) {
  CtSimulation simulation;
  for (const Eigen::Vector3d& place :
       {Eigen::Vector3d(-75, 64, -112), Eigen::Vector3d(-118, 64, -112)}) {
    simulation.plates_mm.push_back(position_(place));
  }
  ASSERT_OK_AND_ASSIGN(const Outcome outcome,
                       CompareWith(pre_, ScanOf(post_, simulation, kThreads)));
  ExpectMovements(outcome, real_);
  ExpectErrorsByRegion(outcome, TrueSkin());
}

TEST_F(OperatedCtTest, AcceptsGrayValuesOfAConeBeamCt) {
  const CtVolume helical = ScanOf(post_, {}, kThreads);
  ConeBeam beam;
  beam.radius_mm = 95;
  beam.axis_mm = position_(Eigen::Vector3d(-97, 102, -80)).head<2>();
  beam.low_z_mm = -160;
  beam.high_z_mm = 20;
  ASSERT_OK_AND_ASSIGN(const Outcome outcome, CompareWith(pre_, ConeBeamOf(helical, beam)));
  ExpectMovements(outcome, real_);
  ExpectErrorsByRegion(outcome, TrueSkin());
}

// A head whose lips slide and part, built as the command builds it.
class PartedLipsTest : public testing::CliTest {};

TEST_F(PartedLipsTest, AFaceWhoseLipsPartedIsMeasured) {
  SetBlasThreads(1);
  ASSERT_EQ(Run({"plan", "build", "--ct", testing::TestDataPath("ct/headsq/headsq_quarter.nhdr"),
                 "--recipe", testing::TestDataPath("plans/head_lips/recipe.json"), "--out", "plan"})
                .exit_code,
            0);
  const PreOperativeHead pre = testing::HeadOfPlan(Path("plan"));
  ASSERT_EQ(pre.problem.contact_use, ContactUse::kOn);
  std::mt19937 random(38);
  const std::vector<HandlePose> real = MissedPlan(pre, &random);
  const RigidMove position = RandomMove(&random, 8, 10);
  const PostOperativeHead post =
      OperatedHead(pre, real, {.stiffer = 2, .noise_mm = 0, .position = position}, &random);
  ASSERT_OK_AND_ASSIGN(const Outcome outcome, CompareWith(pre, ScanOf(post, {}, kThreads)));
  ExpectMovements(outcome, real);
  ExpectErrorsByRegion(outcome, Moved(post.skin, Inverse(position)));
}

}  // namespace
}  // namespace tissueform
