// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <filesystem>
#include <memory>
#include <numeric>
#include <vector>

#include "client/lab/accuracy/accuracy_case.h"
#include "client/lab/accuracy/calculix.h"
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
    return RunCalculix(
        {problem.mesh, problem.stiffness, poisson_ratio, problem.constraints,
         ConstrainedDisplacements(problem.mesh, problem.constraints, problem.poses), law,
         forces_and_stresses, BoneMotions(problem.mesh, problem.constraints, problem.poses)},
        folder_);
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

// The head with rows in place of regions: every second vertex of the handle slides on it, every
// third fixed vertex may lift off its bone, some of these with a gap at rest.
AccuracyCase WithContact(const AccuracyCase& problem) {
  const ConstraintSet& regions = problem.constraints;
  const auto thin = [&](const std::vector<int32_t>& vertices, size_t step, const ContactRow& like,
                        std::vector<ContactRow>* rows) {
    Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
    for (const int32_t v : vertices) middle += problem.mesh.positions().row(v);
    middle /= static_cast<double>(vertices.size());
    std::vector<int32_t> left;
    for (size_t i = 0; i < vertices.size(); ++i) {
      if (i % step != 0) {
        left.push_back(vertices[i]);
        continue;
      }
      ContactRow& row = rows->emplace_back(like);
      row.vertex = vertices[i];
      row.normal = (problem.mesh.positions().row(row.vertex) - middle).normalized();
      if (!row.bilateral && i % 2 == 0) row.gap_mm = 0.05;
    }
    return left;
  };
  std::vector<ContactRow> rows;
  std::vector<HandleRegion> handles = regions.handles();
  handles[0].vertices = thin(handles[0].vertices, 2, {.handle = 0, .bilateral = true}, &rows);
  std::vector<int32_t> fixed = thin(regions.fixed(), 3, {}, &rows);
  AccuracyCase with = problem;
  with.constraints =
      ConstraintSet::Create(problem.mesh, std::move(fixed), std::move(handles), std::move(rows))
          .value();
  return with;
}

TEST_F(CalculixOracleTest, LinearElasticityWithContactEqualsCalculixOnAHead) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase head, HeadChin());
  const AccuracyCase with = WithContact(head);
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

// Two blocks of 3 x 3 x 4 mm, one on the other; the upper one is pressed down and tilted, so that a
// part of the faces lifts off. Vertices of the faces lie in pairs.
AccuracyCase TwoBlocks() {
  const TetMesh block = testing::Bar({6, 6, 8}, 0.5);
  const auto vertices = static_cast<int32_t>(block.num_vertices());
  Positions positions(2 * vertices, 3);
  positions << block.positions(), block.positions().rowwise() + Eigen::RowVector3d(0, 0, 4);
  TetIndices tets(2 * block.num_tets(), 4);
  tets << block.tets(), (block.tets().array() + vertices).matrix();
  const TetMesh mesh = *TetMesh::Create(positions, tets);
  std::vector<ContactRow> rows;
  for (int32_t v = 0; v < vertices; ++v) {
    for (int32_t w = vertices; w < 2 * vertices && positions(v, 2) == 4; ++w) {
      if (positions.row(v) != positions.row(w)) continue;
      rows.push_back({.vertex = w, .other = v, .normal = Eigen::Vector3d::UnitZ()});
    }
  }
  const auto at_height = [&mesh](double height) {
    return testing::SelectVertices(mesh,
                                   [height](const Eigen::Vector3d& x) { return x.z() == height; });
  };
  HandlePose pose;
  pose.rotation_vector = {0.08, 0, 0};
  pose.pivot_mm = {1.5, 1.5, 8};
  pose.translation_mm = {0.03, 0.02, -0.1};
  return {"two_blocks",
          "",
          mesh,
          Eigen::VectorXd::Constant(mesh.num_tets(), 15000),
          ConstraintSet::Create(mesh, at_height(0), {{"top", at_height(8)}}, rows).value(),
          {pose},
          {}};
}

// With another way to say contact: CalculiX integrates the pressure of one surface on the other.
TEST_F(CalculixOracleTest, LinearElasticityWithContactIsCalculixsOfTwoSurfaces) {
  const AccuracyCase blocks = TwoBlocks();
  CalculixProblem problem{blocks.mesh,
                          blocks.stiffness,
                          0.3,
                          blocks.constraints,
                          ConstrainedDisplacements(blocks.mesh, blocks.constraints, blocks.poses),
                          CalculixLaw::kLinear,
                          /*forces_and_stresses=*/true,
                          BoneMotions(blocks.mesh, blocks.constraints, blocks.poses)};
  problem.contact = CalculixContact::kSurfaces;
  ASSERT_OK_AND_ASSIGN(const CalculixResult reference, RunCalculix(problem, folder()));
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

// A block of 3 x 3 x 3.75 mm under a plate that presses, turns and slides by 2 mm in all. The plate
// is wider, so that the block stays under it; as a handle it is rigid.
constexpr double kTop = 3.75;  // mm

AccuracyCase BlockUnderATurningPlate() {
  const TetMesh block = testing::Bar({4, 4, 5}, 0.75);
  const TetMesh plate = testing::Bar({9, 9, 2}, 0.75);
  const auto vertices = static_cast<int32_t>(block.num_vertices());
  Positions positions(vertices + plate.num_vertices(), 3);
  positions << block.positions(),
      plate.positions().rowwise() + Eigen::RowVector3d(-1.875, -1.875, kTop);
  TetIndices tets(block.num_tets() + plate.num_tets(), 4);
  tets << block.tets(), (plate.tets().array() + vertices).matrix();
  const TetMesh mesh = *TetMesh::Create(positions, tets);
  std::vector<ContactRow> rows;
  std::vector<int32_t> bottom;
  for (int32_t v = 0; v < vertices; ++v) {
    if (positions(v, 2) == 0) bottom.push_back(v);
    if (positions(v, 2) == kTop) {
      rows.push_back({.vertex = v, .handle = 0, .normal = -Eigen::Vector3d::UnitZ()});
    }
  }
  std::vector<int32_t> of_plate(static_cast<size_t>(plate.num_vertices()));
  std::iota(of_plate.begin(), of_plate.end(), vertices);
  HandlePose pose;
  pose.rotation_vector = {0.2, -0.15, 0};
  pose.pivot_mm = {1.5, 1.5, kTop};
  pose.translation_mm = {0.7, 0.5, -0.45};
  return {"block_under_plate",
          "",
          mesh,
          Eigen::VectorXd::Constant(mesh.num_tets(), 15000),
          ConstraintSet::Create(mesh, bottom, {{"plate", of_plate}}, rows).value(),
          {pose},
          {}};
}

// The same with a plate of tissue so stiff that it keeps its shape, moved by its upper face, and
// with the vertices of both faces in rows, from which CalculiX takes its surfaces.
CalculixProblem OfTwoSurfaces(const AccuracyCase& problem) {
  const TetMesh& mesh = problem.mesh;
  const std::vector<int32_t>& plate = problem.constraints.handles()[0].vertices;
  std::vector<int32_t> upper;
  std::vector<int32_t> moved;
  for (const int32_t v : plate) {
    if (mesh.positions()(v, 2) == kTop) upper.push_back(v);
    if (mesh.positions()(v, 2) == kTop + 1.5) moved.push_back(v);
  }
  std::vector<ContactRow> rows;
  for (size_t i = 0; i < upper.size(); ++i) {
    const size_t like = i % problem.constraints.contact().size();
    rows.push_back({.vertex = upper[i],
                    .other = problem.constraints.contact()[like].vertex,
                    .normal = Eigen::Vector3d::UnitZ()});
  }
  Eigen::VectorXd stiffness = problem.stiffness;
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
    if (mesh.tets().row(t).minCoeff() >= plate.front()) stiffness[t] *= 1e3;
  }
  const auto constraints =
      ConstraintSet::Create(mesh, problem.constraints.fixed(), {{"plate", moved}}, rows).value();
  return {mesh,
          stiffness,
          0.3,
          constraints,
          ConstrainedDisplacements(mesh, constraints, problem.poses),
          CalculixLaw::kNeoHookean,
          /*forces_and_stresses=*/true,
          BoneMotions(mesh, constraints, problem.poses),
          CalculixContact::kSurfaces};
}

// CalculiX's normals turn with its surfaces, ours with the bone.
TEST_F(CalculixOracleTest, NeoHookeanUnderATurningBoneIsCalculixsOfTwoSurfaces) {
  const AccuracyCase problem = BlockUnderATurningPlate();
  EXPECT_NEAR(LargestMove(problem), 2, 0.1);
  ASSERT_OK_AND_ASSIGN(const CalculixResult reference,
                       RunCalculix(OfTwoSurfaces(problem), folder()));
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
