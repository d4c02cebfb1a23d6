// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <filesystem>
#include <memory>
#include <numeric>
#include <vector>

#include "client/lab/accuracy/accuracy_case.h"
#include "client/lab/accuracy/accuracy_models.h"
#include "client/lab/accuracy/calculix.h"
#include "client/lab/accuracy/contact_cases.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/elasticity/elastic_state.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

// The elastic models against an independent program. Without ccx these tests fail: it is one of
// deploy/packages.txt.
class CalculixOracleTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = ::testing::TempDir() + "/calculix_oracle_test." + info->name();
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // Largest distance of a vertex between the model and CalculiX, mm.
  absl::StatusOr<double> Distance(const AccuracyCase& problem, DeformationModel model,
                                  double poisson_ratio) const {
    const auto reference = Reference(problem, model, poisson_ratio, false);
    if (!reference.ok()) return reference.status();
    const auto answer = Answer(problem, model, poisson_ratio);
    if (!answer.ok()) return answer.status();
    return (*answer - reference->deformed).rowwise().norm().maxCoeff();
  }

  absl::StatusOr<CalculixResult> Reference(const AccuracyCase& problem, DeformationModel model,
                                           double poisson_ratio, bool forces_and_stresses) const {
    const CalculixLaw law =
        model == DeformationModel::kLinearElastic ? CalculixLaw::kLinear : CalculixLaw::kNeoHookean;
    CalculixProblem of_calculix = ForCalculix(problem, poisson_ratio, law);
    of_calculix.forces_and_stresses = forces_and_stresses;
    return RunCalculix(of_calculix, folder_);
  }

  static absl::StatusOr<Positions> Answer(const AccuracyCase& problem, DeformationModel model,
                                          double poisson_ratio) {
    auto deformation = DeformationOf(problem, model, poisson_ratio);
    if (!deformation.ok()) return deformation.status();
    return deformation->positions;
  }

  static absl::StatusOr<Deformation> DeformationOf(const AccuracyCase& problem,
                                                   DeformationModel model, double poisson_ratio) {
    PreparationOptions options;
    options.poisson_ratio = poisson_ratio;
    const auto preparation = MeshPreparation::Create(problem.mesh, problem.stiffness,
                                                     problem.constraints, std::move(options));
    if (!preparation.ok()) return preparation.status();
    DeformerOptions deformer_options;
    deformer_options.model = model;
    const auto deformer = CreateDeformer(*preparation, deformer_options);
    if (!deformer.ok()) return deformer.status();
    auto deformation = (*deformer)->Deform(problem.poses);
    if (!deformation.ok()) return deformation.status();
    if (!deformation->summary.converged) return absl::InternalError("not converged");
    return deformation;
  }
  const std::string& folder() const { return folder_; }

 private:
  std::string folder_;
};

// Coarse enough for sanitizers.
constexpr std::array<int, 3> kBlockCells = {12, 9, 8};
constexpr int kBarCells = 4;

absl::StatusOr<AccuracyCase> Tongue() {
  return CaseOfPlan("tongue", "", testing::TestDataPath("plans/tongue/plan.json"));
}

double LargestMove(const AccuracyCase& problem) {
  return ConstrainedDisplacements(problem.mesh, problem.constraints, problem.poses)
      .rowwise()
      .norm()
      .maxCoeff();
}

// The coarser of the bundled heads: three stiffnesses by tissue.
absl::StatusOr<AccuracyCase> HeadChin() {
  return CaseOfPlan("head_chin", "", testing::TestDataPath("plans/head_chin/plan.json"));
}

TEST_F(CalculixOracleTest, LinearElasticityWithContactEqualsCalculixOnAHead) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase head, HeadChin());
  ASSERT_OK_AND_ASSIGN(const AccuracyCase with, WithContactRows(head));
  ASSERT_OK_AND_ASSIGN(const double distance,
                       Distance(with, DeformationModel::kLinearElastic, 0.45));
  // Of a movement of 4 mm; its share from kSmallMotion, which 1e-4 makes eight times larger.
  EXPECT_LT(distance, 2e-5);
  // The rows matter.
  ASSERT_OK_AND_ASSIGN(const Positions sticking,
                       Answer(head, DeformationModel::kLinearElastic, 0.45));
  ASSERT_OK_AND_ASSIGN(const Positions sliding,
                       Answer(with, DeformationModel::kLinearElastic, 0.45));
  EXPECT_GT((sticking - sliding).rowwise().norm().maxCoeff(), 0.1);
}

// With another way to say contact: CalculiX integrates the pressure of one surface on the other.
TEST_F(CalculixOracleTest, LinearElasticityWithContactIsCalculixsOfTwoSurfaces) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase blocks, TwoBlocks());
  ASSERT_OK_AND_ASSIGN(const CalculixResult reference,
                       RunCalculix(TwoBlocksForCalculix(blocks), folder()));
  ASSERT_OK_AND_ASSIGN(const Deformation answer,
                       DeformationOf(blocks, DeformationModel::kLinearElastic, 0.3));
  const auto open = std::ranges::count(answer.contact.forces, 0.0);
  EXPECT_GT(open, 5);
  EXPECT_LT(open, 40) << "of 49";
  const double distance = (answer.positions - reference.deformed).rowwise().norm().maxCoeff();
  EXPECT_LT(distance, 5e-4 * LargestMove(blocks));
  const double force =
      std::accumulate(answer.contact.forces.begin(), answer.contact.forces.end(), 0.0);
  const Eigen::RowVector3d expected =
      reference.forces(blocks.constraints.fixed(), Eigen::all).colwise().sum();
  EXPECT_NEAR(force, expected.z(), 1e-3 * expected.z());
}

// CalculiX's normals turn with its surfaces, ours with the bone.
TEST_F(CalculixOracleTest, NeoHookeanUnderATurningBoneIsCalculixsOfTwoSurfaces) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase problem, BlockUnderPlate());
  EXPECT_NEAR(LargestMove(problem), 2, 0.1);
  ASSERT_OK_AND_ASSIGN(const CalculixProblem of_surfaces, BlockUnderPlateForCalculix(problem));
  ASSERT_OK_AND_ASSIGN(const CalculixResult reference, RunCalculix(of_surfaces, folder()));
  ASSERT_OK_AND_ASSIGN(const Deformation answer,
                       DeformationOf(problem, DeformationModel::kNeoHookean, 0.3));
  const auto open = std::ranges::count(answer.contact.forces, 0.0);
  EXPECT_GT(open, 2);
  EXPECT_LT(open, 20) << "of 25";
  const double distance = (answer.positions - reference.deformed).rowwise().norm().maxCoeff();
  EXPECT_LT(distance, 0.03 * LargestMove(problem));
  const Eigen::RowVector3d expected =
      reference.forces(problem.constraints.fixed(), Eigen::all).colwise().sum();
  const double force =
      std::accumulate(answer.contact.forces.begin(), answer.contact.forces.end(), 0.0);
  EXPECT_NEAR(force, expected.norm(), 0.03 * expected.norm());
}

// CalculiX prints seven digits: up to 5e-7 mm for each coordinate of a move of some millimetres.
TEST_F(CalculixOracleTest, LinearElasticityEqualsCalculixOnTheLayeredBlock) {
  for (const double poisson_ratio : {0.0, 0.3, 0.45}) {
    for (const auto& problem : {BlockAlongCase(kBlockCells), BlockUpCase(kBlockCells)}) {
      ASSERT_OK_AND_ASSIGN(
          const double distance,
          Distance(problem.value(), DeformationModel::kLinearElastic, poisson_ratio));
      EXPECT_LT(distance, 1e-6) << problem->name << ", nu = " << poisson_ratio;
    }
  }
}

TEST_F(CalculixOracleTest, LinearElasticityEqualsCalculixOnABarWhoseEndTurns) {
  for (const double poisson_ratio : {0.3, 0.45, 0.49}) {
    ASSERT_OK_AND_ASSIGN(
        const double distance,
        Distance(BendCase(kBarCells).value(), DeformationModel::kLinearElastic, poisson_ratio));
    // Twice: the end goes aside by 8 mm.
    EXPECT_LT(distance, 2e-6) << "nu = " << poisson_ratio;
  }
}

TEST_F(CalculixOracleTest, LinearElasticityEqualsCalculixOnTheTongue) {
  for (const double poisson_ratio : {0.3, 0.45}) {
    ASSERT_OK_AND_ASSIGN(
        const double distance,
        Distance(Tongue().value(), DeformationModel::kLinearElastic, poisson_ratio));
    EXPECT_LT(distance, 1e-6) << "nu = " << poisson_ratio;
  }
}

TEST_F(CalculixOracleTest, LinearElasticityEqualsCalculixOnARealHead) {
  ASSERT_OK_AND_ASSIGN(const double distance,
                       Distance(HeadChin().value(), DeformationModel::kLinearElastic, 0.45));
  EXPECT_LT(distance, 1e-6);
}

TEST_F(CalculixOracleTest, NeoHookeanEqualsCalculixOnTheLayeredBlock) {
  for (const auto& problem : {BlockAlongCase(kBlockCells), BlockUpCase(kBlockCells)}) {
    ASSERT_OK_AND_ASSIGN(const double distance,
                         Distance(problem.value(), DeformationModel::kNeoHookean, 0.45));
    EXPECT_LT(distance, 1e-3 * LargestMove(*problem)) << problem->name;
  }
}

TEST_F(CalculixOracleTest, NeoHookeanEqualsCalculixOnABarBentAndTwisted) {
  for (const auto& problem : {BendCase(kBarCells), TwistAndStretchCase(kBarCells)}) {
    ASSERT_OK_AND_ASSIGN(const double distance,
                         Distance(problem.value(), DeformationModel::kNeoHookean, 0.45));
    EXPECT_LT(distance, 1e-3 * LargestMove(*problem)) << problem->name;
  }
}

TEST_F(CalculixOracleTest, NeoHookeanEqualsCalculixOnTheTongue) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase tongue, Tongue());
  ASSERT_OK_AND_ASSIGN(const double distance,
                       Distance(tongue, DeformationModel::kNeoHookean, 0.45));
  EXPECT_LT(distance, 1e-3 * LargestMove(tongue));
}

// Von Mises of CalculiX's stresses: xx, yy, zz, xy, xz, yz.
Eigen::VectorXd VonMises(const Eigen::MatrixXd& s) {
  const auto normal = (s.col(0) - s.col(1)).array().square() +
                      (s.col(1) - s.col(2)).array().square() +
                      (s.col(2) - s.col(0)).array().square();
  return (0.5 * normal + 3 * s.rightCols(3).array().square().rowwise().sum()).sqrt();
}

// What holds the first handle, by CalculiX, N.
Eigen::Vector3d HandleForce(const AccuracyCase& problem, const CalculixResult& reference) {
  const auto& handle = problem.constraints.handles()[0].vertices;
  return 1e-6 * reference.forces(handle, Eigen::all).colwise().sum().transpose();
}

ElasticState StateAt(const AccuracyCase& problem, DeformationModel model, double poisson_ratio,
                     const Positions& positions) {
  return MeasureElasticState(
      model == DeformationModel::kLinearElastic ? ElasticLaw::kLinear : ElasticLaw::kNeoHookean,
      ElementsOf(problem.mesh), positions, problem.stiffness, poisson_ratio);
}

// Of the very positions that CalculiX has found, so that only their digits are between us. Its
// stresses are Cauchy's, its forces those that hold the vertices.
TEST_F(CalculixOracleTest, ForcesAndStressesOfOneStateEqualCalculix) {
  constexpr double kNu = 0.45;
  for (const auto& problem : {BlockUpCase(kBlockCells), TwistAndStretchCase(kBarCells)}) {
    for (const auto model : {DeformationModel::kLinearElastic, DeformationModel::kNeoHookean}) {
      ASSERT_OK_AND_ASSIGN(const CalculixResult reference,
                           Reference(problem.value(), model, kNu, true));
      const ElasticState state = StateAt(*problem, model, kNu, reference.deformed);
      const Eigen::VectorXd von_mises = VonMises(reference.stresses);
      EXPECT_LT((state.von_mises_pa - von_mises).cwiseAbs().maxCoeff(), 1e-5 * von_mises.maxCoeff())
          << problem->name;
      const Positions forces = 1e-6 * reference.forces;
      // Forces are sums in which the large ones of neighbouring tets, which resist changes of
      // volume, go against each other: the rounding of the positions shows more.
      EXPECT_LT((state.forces_n - forces).norm(), 1e-4 * forces.norm()) << problem->name;
    }
  }
}

// Each by its own solver; CalculiX's search for the neo-Hookean equilibrium stops at 5e-3 of the
// forces.
TEST_F(CalculixOracleTest, ReactionsOfTheModelsEqualCalculix) {
  const auto difference = [this](const AccuracyCase& problem, DeformationModel model) {
    const CalculixResult reference = Reference(problem, model, 0.45, true).value();
    const ElasticState state = StateAt(problem, model, 0.45, Answer(problem, model, 0.45).value());
    const Eigen::Vector3d expected = HandleForce(problem, reference);
    const auto& handle = problem.constraints.handles()[0].vertices;
    return (ResultantOf(state, handle).force_n - expected).norm() / expected.norm();
  };
  ASSERT_OK_AND_ASSIGN(const AccuracyCase bend, BendCase(kBarCells));
  EXPECT_LT(difference(bend, DeformationModel::kLinearElastic), 1e-5);
  EXPECT_LT(difference(bend, DeformationModel::kNeoHookean), 5e-3);
  EXPECT_LT(difference(Tongue().value(), DeformationModel::kLinearElastic), 1e-5);
}

}  // namespace
}  // namespace tissueform
