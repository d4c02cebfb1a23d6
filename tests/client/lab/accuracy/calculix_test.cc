// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/calculix.h"

#include <filesystem>
#include <fstream>

#include <sys/stat.h>

#include "tests/testing/meshes.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using ::testing::Not;
using testing::ScopedEnvironment;

class CalculixTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = ::testing::TempDir() + "/calculix_test." + info->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // A program named ccx that does what the script says.
  void PutCcx(const std::string& script) const {
    std::ofstream(folder_ + "/ccx") << "#!/bin/sh\n" << script;
    chmod((folder_ + "/ccx").c_str(), 0755);
  }

  std::string folder_;
};

// A bar of two materials whose upper end is stretched by a tenth without contracting across.
CalculixProblem StretchedBar(CalculixLaw law) {
  TetMesh bar = testing::Bar({2, 2, 4}, 1.5, 0.1);
  Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(bar.num_tets(), 3000);
  stiffness.tail(bar.num_tets() / 2).setConstant(15000.125);
  ConstraintSet ends = testing::BarEnds(bar, 0.5);
  HandlePose pose;
  pose.translation_mm = {0.25, -0.125, 0.6};
  Positions displacements = ConstrainedDisplacements(bar, ends, {pose});
  return {std::move(bar),  std::move(stiffness),     0.3,
          std::move(ends), std::move(displacements), law};
}

TEST_F(CalculixTest, InputHasOneMaterialForEachStiffnessOfTheLaw) {
  const std::string linear = CalculixInput(StretchedBar(CalculixLaw::kLinear));
  EXPECT_THAT(linear, HasSubstr("*ELASTIC\n3000, 0.3\n"));
  EXPECT_THAT(linear, HasSubstr("*ELASTIC\n15000.125, 0.3\n"));
  EXPECT_THAT(linear, Not(HasSubstr("M3")));
  EXPECT_THAT(linear, Not(HasSubstr("NLGEOM")));
  const std::string neo_hookean = CalculixInput(StretchedBar(CalculixLaw::kNeoHookean));
  EXPECT_THAT(neo_hookean, HasSubstr("NLGEOM"));
  // 3000 / (4 * 1.3) and 6 * 0.4 / 3000
  EXPECT_THAT(neo_hookean, HasSubstr("NEO HOOKE\n576.9230769231, 0.0008\n"));
}

TEST_F(CalculixTest, NoFieldOfTheInputIsLongerThanCalculixReads) {
  CalculixProblem problem = StretchedBar(CalculixLaw::kLinear);
  problem.displacements(0, 0) = -1.0 / 3e17;
  problem.displacements(0, 1) = -1.0 / 3e107;
  const std::string input = CalculixInput(problem);
  EXPECT_THAT(input, HasSubstr("-3.333333333333e-18"));
  for (size_t begin = 0; begin < input.size();) {
    const size_t end = input.find_first_of(",\n", begin);
    if (input[begin] != '*') {
      EXPECT_LE(end - begin, 21U) << input.substr(begin, end - begin);  // 20 and a space
    }
    begin = end + 1;
  }
}

TEST_F(CalculixTest, ConstrainedVerticesAreWhereTheyWerePut) {
  for (const CalculixLaw law : {CalculixLaw::kLinear, CalculixLaw::kNeoHookean}) {
    const CalculixProblem problem = StretchedBar(law);
    ASSERT_OK_AND_ASSIGN(const CalculixResult result, RunCalculix(problem, folder_));
    const std::vector<int32_t>& constrained = problem.constraints.constrained();
    const Positions moved = result.deformed - problem.mesh.positions();
    EXPECT_LT((moved(constrained, Eigen::all) - problem.displacements).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_GT(moved.rowwise().norm().mean(), 0.1);
    EXPECT_GT(result.seconds, 0);
  }
}

TEST_F(CalculixTest, LinearFieldIsReproducedByBothLaws) {
  // The patch test: the whole boundary follows a uniform stretch, so must what lies within.
  CalculixProblem problem = StretchedBar(CalculixLaw::kLinear);
  const TetMesh& bar = problem.mesh;
  std::vector<int32_t> boundary = testing::SelectVertices(bar, [](const Eigen::Vector3d& v) {
    return (v.array() < 0.5).any() || v.x() > 2.5 || v.y() > 2.5 || v.z() > 5.5;
  });
  problem.stiffness.setConstant(3000);
  ASSERT_OK_AND_ASSIGN(problem.constraints,
                       ConstraintSet::Create(bar, {}, {{"boundary", std::move(boundary)}}));
  const Positions field = bar.positions() * 0.05;
  problem.displacements = field(problem.constraints.constrained(), Eigen::all);
  for (const CalculixLaw law : {CalculixLaw::kLinear, CalculixLaw::kNeoHookean}) {
    problem.law = law;
    ASSERT_OK_AND_ASSIGN(const CalculixResult result, RunCalculix(problem, folder_));
    EXPECT_LT((result.deformed - bar.positions() - field).cwiseAbs().maxCoeff(), 1e-6);
  }
}

TEST_F(CalculixTest, LastBlockOfThePrintedDisplacementsCounts) {
  constexpr char kDat[] =
      "\n displacements (vx,vy,vz) for set ALL and time  0.5000000E+00\n\n"
      "         1  1.000000E+00  0.000000E+00  0.000000E+00\n"
      "         2  1.000000E+00  0.000000E+00  0.000000E+00\n"
      "\n displacements (vx,vy,vz) for set ALL and time  0.1000000E+01\n\n"
      "         1  2.000000E+00 -3.000000E-01  0.000000E+00\n"
      "         2  4.000000E+00  0.000000E+00  5.000000E-07\n";
  ASSERT_OK_AND_ASSIGN(const Positions parsed, ParseCalculixDisplacements(kDat, 2));
  EXPECT_EQ(parsed, (Positions(2, 3) << 2, -0.3, 0, 4, 0, 5e-7).finished());
  EXPECT_THAT(ParseCalculixDisplacements(kDat, 3).status().message(),
              HasSubstr("2 displacements for 3 vertices"));
}

TEST_F(CalculixTest, StepThatDidNotEndIsAnError) {
  EXPECT_THAT(ParseCalculixDisplacements(" displacements for set ALL and time  0.5E+00\n\n"
                                         " 1  1.0E+00  0.0E+00  0.0E+00\n",
                                         1)
                  .status()
                  .message(),
              HasSubstr("only at time 0.5"));
  EXPECT_FALSE(ParseCalculixDisplacements("", 1).ok());
}

TEST_F(CalculixTest, ForcesAndStressesAreDistinguishedAndStressesOfTissuesMerged) {
  constexpr char kDat[] =
      "\n displacements (vx,vy,vz) for set ALL and time  0.1000000E+01\n\n"
      "         1  2.000000E+00 -3.000000E-01  0.000000E+00\n"
      "\n forces (fx,fy,fz) for set ALL and time  0.1000000E+01\n\n"
      "         1  7.000000E+00  8.000000E+00  9.000000E+00\n"
      "\n stresses (elem, integ.pnt.,sxx,syy,szz,sxy,sxz,syz) for set E1 and time  0.1E+01\n\n"
      "         2   1  1.0E+00  2.0E+00  3.0E+00  4.0E+00  5.0E+00  6.0E+00\n"
      "\n stresses (elem, integ.pnt.,sxx,syy,szz,sxy,sxz,syz) for set E2 and time  0.1E+01\n\n"
      "         1   1 -1.0E+00 -2.0E+00 -3.0E+00 -4.0E+00 -5.0E+00 -6.0E+00\n";
  ASSERT_OK_AND_ASSIGN(const Positions displacements, ParseCalculixDisplacements(kDat, 1));
  EXPECT_EQ(displacements, Positions({{2, -0.3, 0}}));
  ASSERT_OK_AND_ASSIGN(const Positions forces, ParseCalculixForces(kDat, 1));
  EXPECT_EQ(forces, Positions({{7, 8, 9}}));
  ASSERT_OK_AND_ASSIGN(const Eigen::MatrixXd stresses, ParseCalculixStresses(kDat, 2));
  EXPECT_EQ(stresses, Eigen::MatrixXd({{-1, -2, -3, -4, -5, -6}, {1, 2, 3, 4, 5, 6}}));
  EXPECT_THAT(ParseCalculixStresses(kDat, 3).status().message(),
              HasSubstr("2 stresses for 3 tets"));
}

TEST_F(CalculixTest, MissingProgramNamesItsPackage) {
  const ScopedEnvironment no_programs("PATH", "/nonexistent");
  const auto result = RunCalculix(StretchedBar(CalculixLaw::kLinear), folder_);
  EXPECT_TRUE(absl::IsNotFound(result.status()));
  EXPECT_THAT(result.status().message(), HasSubstr("install the package calculix-ccx"));
}

TEST_F(CalculixTest, FailureQuotesTheLastLineOfTheProgram) {
  PutCcx("echo hello\necho ' *ERROR in e_c3d: nonpositive jacobian'\necho\nexit 201\n");
  const ScopedEnvironment programs("PATH", folder_.c_str());
  const auto result = RunCalculix(StretchedBar(CalculixLaw::kLinear), folder_);
  EXPECT_TRUE(absl::IsInternal(result.status()));
  EXPECT_THAT(result.status().message(), HasSubstr("*ERROR in e_c3d: nonpositive jacobian"));
}

TEST_F(CalculixTest, IgnoresResultsOfAnEarlierRun) {
  ASSERT_THAT(RunCalculix(StretchedBar(CalculixLaw::kLinear), folder_), IsOk());
  PutCcx("exit 0\n");
  const ScopedEnvironment programs("PATH", folder_.c_str());
  EXPECT_FALSE(RunCalculix(StretchedBar(CalculixLaw::kLinear), folder_).ok());
}

TEST_F(CalculixTest, ArraysOfTheWrongLengthAreRefused) {
  CalculixProblem problem = StretchedBar(CalculixLaw::kLinear);
  problem.displacements.conservativeResize(3, 3);
  EXPECT_TRUE(absl::IsInvalidArgument(RunCalculix(problem, folder_).status()));
  problem = StretchedBar(CalculixLaw::kLinear);
  problem.stiffness.conservativeResize(3);
  EXPECT_TRUE(absl::IsInvalidArgument(RunCalculix(problem, folder_).status()));
}

}  // namespace
}  // namespace tissueform
