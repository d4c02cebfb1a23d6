// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/gradient_field_deformer.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <unsupported/Eigen/MatrixFunctions>

#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mesh/operators/gradient.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::LargestDistance;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;

struct Problem {
  std::shared_ptr<const TetMesh> mesh;
  Eigen::VectorXd stiffness;
  ConstraintSet constraints;

  absl::StatusOr<std::unique_ptr<Deformer>> CreateDeformer(
      GradientFieldOptions options = {}) const {
    options.compute_residual = true;
    return CreateGradientFieldDeformer(*mesh, stiffness, constraints, options);
  }
};

Eigen::VectorXd RandomStiffness(Eigen::Index num_tets) {
  std::mt19937 generator(3);
  Eigen::VectorXd stiffness(num_tets);
  for (double& value : stiffness) {
    value = 3000.0 + 50000.0 * generator() / 4294967295.0;
  }
  return stiffness;
}

// Below `low` along z fixed; above `high` two handles, left and right of the middle (one when
// `handles` is 1).
Problem MakeProblem(TetMesh mesh, int handles, double low_part = 0.15, double high_part = 0.85) {
  auto shared = std::make_shared<const TetMesh>(std::move(mesh));
  const Eigen::RowVector3d low_corner = shared->positions().colwise().minCoeff();
  const Eigen::RowVector3d size = shared->positions().colwise().maxCoeff() - low_corner;
  const double low = low_corner.z() + low_part * size.z();
  const double high = low_corner.z() + high_part * size.z();
  const double middle = low_corner.x() + 0.5 * size.x();
  const auto fixed =
      testing::SelectVertices(*shared, [&](const Eigen::Vector3d& v) { return v.z() <= low; });
  std::vector<HandleRegion> regions;
  if (handles == 1) {
    regions.push_back({"top", testing::SelectVertices(*shared, [&](const Eigen::Vector3d& v) {
                         return v.z() >= high;
                       })});
  } else {
    // A gap between the handles keeps tets from being torn.
    regions.push_back({"left", testing::SelectVertices(*shared, [&](const Eigen::Vector3d& v) {
                         return v.z() >= high && v.x() < middle - 0.2 * size.x();
                       })});
    regions.push_back({"right", testing::SelectVertices(*shared, [&](const Eigen::Vector3d& v) {
                         return v.z() >= high && v.x() > middle + 0.2 * size.x();
                       })});
  }
  auto constraints = ConstraintSet::Create(*shared, fixed, regions);
  const Eigen::Index num_tets = shared->num_tets();
  return {std::move(shared), RandomStiffness(num_tets), std::move(constraints).value()};
}

HandlePose SomePose(double size) {
  HandlePose pose;
  pose.rotation_vector = {0.4, -0.3, 0.9};
  pose.pivot_mm = Eigen::Vector3d(0.1, 0.2, 0.7) * size;
  pose.translation_mm = Eigen::Vector3d(0.05, -0.08, 0.03) * size;
  pose.scale = 1.2;
  return pose;
}

Eigen::Matrix3d MatrixExponential(const Eigen::Vector3d& w) {
  Eigen::Matrix3d matrix;
  matrix << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return matrix.exp();
}

// The method from its definition, densely: L = G^T M' G, harmonic fields, P per tet by the matrix
// exponential, L x' = G^T M' (P grad v) for absolute positions. Shares neither the cotangent
// assembly nor the displacement form nor the sparse factor with the deformer.
Positions DenseOracle(const Problem& problem, const std::vector<HandlePose>& poses) {
  const TetMesh& mesh = *problem.mesh;
  const Eigen::MatrixXd G(Gradient(mesh));
  const Eigen::MatrixXd D(Divergence(mesh, problem.stiffness));
  Eigen::MatrixXd L = D * G;
  const auto& constrained = problem.constraints.constrained();
  const auto& regions = problem.constraints.region_of_constrained();
  const auto num_handles = static_cast<Eigen::Index>(poses.size());
  Eigen::MatrixXd field_rhs = Eigen::MatrixXd::Zero(mesh.num_vertices(), num_handles);
  for (size_t c = 0; c < constrained.size(); ++c) {
    L.row(constrained[c]).setZero();
    L(constrained[c], constrained[c]) = 1;
    if (regions[c] >= 0) {
      field_rhs(constrained[c], regions[c]) = 1;
    }
  }
  const Eigen::FullPivLU<Eigen::MatrixXd> factor(L);
  const Eigen::MatrixXd fields = factor.solve(field_rhs);

  Eigen::MatrixXd gradients = G * mesh.positions();  // 3 #T by 3, transposed Jacobians
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
    Eigen::Vector3d w = Eigen::Vector3d::Zero();
    double scale = 1;
    for (Eigen::Index h = 0; h < num_handles; ++h) {
      double u = 0;
      for (int corner = 0; corner < 4; ++corner) {
        u += fields(mesh.tets()(t, corner), h) / 4;
      }
      w += u * poses[h].rotation_vector;
      scale += u * (poses[h].scale - 1);
    }
    gradients.middleRows<3>(3 * t) =
        gradients.middleRows<3>(3 * t) * (scale * MatrixExponential(w)).transpose();
  }
  Eigen::MatrixXd rhs = D * gradients;
  for (size_t c = 0; c < constrained.size(); ++c) {
    const Eigen::Vector3d v = mesh.positions().row(constrained[c]);
    rhs.row(constrained[c]) = regions[c] < 0 ? v : ApplyPose(poses[regions[c]], v);
  }
  return factor.solve(rhs);
}

struct Case {
  std::string name;
  Problem (*make)();
};

void PrintTo(const Case& test_case, std::ostream* os) { *os << test_case.name; }

class GradientFieldDeformerTest : public ::testing::TestWithParam<Case> {
 protected:
  std::vector<HandlePose> SomePoses() const {
    std::vector<HandlePose> poses(problem_.constraints.handles().size(), SomePose(size_));
    if (poses.size() > 1) {
      poses[1].rotation_vector = {-0.2, 0.5, 0.1};
      poses[1].scale = 0.9;
      poses[1].translation_mm *= -1;
    }
    return poses;
  }

  const Problem problem_ = GetParam().make();
  const double size_ = problem_.mesh->BoundingBoxDiagonal();
};

TEST_P(GradientFieldDeformerTest, IdentityPosesGiveTheRestShapeExactly) {
  ASSERT_OK_AND_ASSIGN(const auto deformer, problem_.CreateDeformer());
  const std::vector<HandlePose> poses(problem_.constraints.handles().size());
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
  EXPECT_EQ(result.positions, problem_.mesh->positions());
}

TEST_P(GradientFieldDeformerTest, ConstrainedVerticesGoExactlyWhereTheirPosesSay) {
  ASSERT_OK_AND_ASSIGN(const auto deformer, problem_.CreateDeformer());
  const std::vector<HandlePose> poses = SomePoses();
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
  for (const int32_t v : problem_.constraints.fixed()) {
    EXPECT_EQ(result.positions.row(v), problem_.mesh->positions().row(v));
  }
  for (size_t h = 0; h < poses.size(); ++h) {
    for (const int32_t v : problem_.constraints.handles()[h].vertices) {
      const Eigen::Vector3d expected =
          ApplyPose(poses[h], problem_.mesh->positions().row(v).transpose());
      EXPECT_LT((result.positions.row(v).transpose() - expected).norm(), 1e-14 * size_);
    }
  }
}

// v + sum u_h t_h, with the fields read off unit translations (linear in the pose) of another
// direction.
TEST_P(GradientFieldDeformerTest, TranslationsSpreadAlongTheHarmonicFields) {
  ASSERT_OK_AND_ASSIGN(const auto deformer, problem_.CreateDeformer());
  const size_t num_handles = problem_.constraints.handles().size();
  Positions expected = problem_.mesh->positions();
  std::vector<HandlePose> all(num_handles);
  for (size_t h = 0; h < num_handles; ++h) {
    std::vector<HandlePose> one(num_handles);
    one[h].translation_mm = {0, 0, size_};
    ASSERT_OK_AND_ASSIGN(const Deformation unit, deformer->Deform(one));
    const Eigen::VectorXd field = (unit.positions - problem_.mesh->positions()).col(2) / size_;
    all[h].translation_mm = SomePose(size_).translation_mm * (h == 0 ? 1.0 : -2.0);
    expected += field * all[h].translation_mm.transpose();
  }
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(all));
  EXPECT_LT(LargestDistance(result.positions, expected), 1e-10 * size_);
}

// Moving the whole experiment by a rigid motion moves the answer by it.
TEST_P(GradientFieldDeformerTest, RigidMotionOfEverythingMovesTheAnswer) {
  const Eigen::Matrix3d R = RotationMatrix({1.1, -0.4, 0.6});
  const Eigen::Vector3d shift = Eigen::Vector3d(0.3, -0.5, 0.2) * size_;
  const auto move = [&](const Positions& x) -> Positions {
    return (x * R.transpose()).rowwise() + shift.transpose();
  };
  Problem moved{std::make_shared<const TetMesh>(
                    *TetMesh::Create(move(problem_.mesh->positions()), problem_.mesh->tets())),
                problem_.stiffness, problem_.constraints};
  const std::vector<HandlePose> poses = SomePoses();
  std::vector<HandlePose> moved_poses = poses;
  for (HandlePose& pose : moved_poses) {
    pose.rotation_vector = R * pose.rotation_vector;
    pose.pivot_mm = R * pose.pivot_mm + shift;
    pose.translation_mm = R * pose.translation_mm;
  }
  ASSERT_OK_AND_ASSIGN(const auto deformer, problem_.CreateDeformer());
  ASSERT_OK_AND_ASSIGN(const auto moved_deformer, moved.CreateDeformer());
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
  ASSERT_OK_AND_ASSIGN(const Deformation moved_result, moved_deformer->Deform(moved_poses));
  EXPECT_LT(LargestDistance(moved_result.positions, move(result.positions)), 1e-9 * size_);
}

TEST_P(GradientFieldDeformerTest, AnswerDoesNotDependOnTheUnitOfStiffness) {
  Problem in_kilopascal = problem_;
  in_kilopascal.stiffness /= 1000;
  ASSERT_OK_AND_ASSIGN(const auto deformer, problem_.CreateDeformer());
  ASSERT_OK_AND_ASSIGN(const auto other, in_kilopascal.CreateDeformer());
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(SomePoses()));
  ASSERT_OK_AND_ASSIGN(const Deformation other_result, other->Deform(SomePoses()));
  EXPECT_LT(LargestDistance(result.positions, other_result.positions), 1e-9 * size_);
}

TEST_P(GradientFieldDeformerTest, BackendsAgree) {
  ASSERT_OK_AND_ASSIGN(const auto cholmod, problem_.CreateDeformer());
  GradientFieldOptions options;
  options.backend = CholeskyBackend::kEigen;
  ASSERT_OK_AND_ASSIGN(const auto eigen, problem_.CreateDeformer(options));
  ASSERT_OK_AND_ASSIGN(const Deformation a, cholmod->Deform(SomePoses()));
  ASSERT_OK_AND_ASSIGN(const Deformation b, eigen->Deform(SomePoses()));
  EXPECT_LT(LargestDistance(a.positions, b.positions), 1e-10 * size_);
  EXPECT_LT(a.summary.residual, 1e-10);
}

TEST_P(GradientFieldDeformerTest, PoseBackAtRestUndoesADrag) {
  ASSERT_OK_AND_ASSIGN(const auto deformer, problem_.CreateDeformer());
  ASSERT_OK_AND_ASSIGN(const Deformation first, deformer->Deform(SomePoses()));
  const std::vector<HandlePose> rest(problem_.constraints.handles().size());
  ASSERT_THAT(deformer->Deform(rest), IsOk());
  ASSERT_OK_AND_ASSIGN(const Deformation again, deformer->Deform(SomePoses()));
  EXPECT_EQ(first.positions, again.positions);
}

Problem TetProblem() {
  auto mesh = std::make_shared<const TetMesh>(testing::SingleTet());
  auto constraints = ConstraintSet::Create(*mesh, {0, 1}, {{"top", {3}}});
  return {mesh, Eigen::VectorXd::Constant(1, 1000.0), std::move(constraints).value()};
}
Problem BarProblem() { return MakeProblem(testing::Bar({4, 4, 8}, 2.0, 0.2), 2); }
Problem TongueProblem() {
  return MakeProblem(testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu"), 1);
}
Problem RaptorProblem() {
  return MakeProblem(testing::LoadTestMesh("meshes/tet_sofa_raptor/raptorTetra_8418.vtu"), 1);
}

INSTANTIATE_TEST_SUITE_P(Meshes, GradientFieldDeformerTest,
                         ::testing::Values(Case{"Tet", TetProblem}, Case{"JitteredBar", BarProblem},
                                           Case{"Tongue", TongueProblem},
                                           Case{"Raptor", RaptorProblem}),
                         [](const auto& test) { return test.param.name; });

TEST(GradientFieldDeformerOracleTest, EqualsTheDefinitionSolvedDensely) {
  for (const int handles : {1, 2}) {
    const Problem problem = MakeProblem(testing::Bar({3, 3, 6}, 2.0, 0.2), handles);
    const double size = problem.mesh->BoundingBoxDiagonal();
    std::vector<HandlePose> poses(handles, SomePose(size));
    poses.back().rotation_vector = {0.1, 2.5, -0.4};
    ASSERT_OK_AND_ASSIGN(const auto deformer, problem.CreateDeformer());
    ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
    EXPECT_LT(LargestDistance(result.positions, DenseOracle(problem, poses)), 1e-11 * size)
        << handles;
  }
}

TEST(GradientFieldDeformerOracleTest, FullTwistIsNotNothing) {
  Problem problem = MakeProblem(testing::Bar({3, 3, 12}, 1.0), 1, 0.01, 0.99);
  HandlePose pose;
  pose.pivot_mm = {1.5, 1.5, 0};
  pose.rotation_vector = {0, 0, 2 * std::numbers::pi};
  ASSERT_OK_AND_ASSIGN(const auto deformer, problem.CreateDeformer());
  const std::vector<HandlePose> poses = {pose};
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
  EXPECT_LT(LargestDistance(result.positions, DenseOracle(problem, poses)), 1e-10);
  // The middle section stands turned by half a turn: an outer vertex is on the other side.
  const DeformationQuality quality = MeasureDeformation(*problem.mesh, result.positions);
  EXPECT_GT(quality.max_displacement_mm, 2.5);
  EXPECT_EQ(quality.inverted_tets, 0);
}

TEST(GradientFieldDeformerOracleTest, WithoutRotationTheAnswerIsTheHarmonicExtension) {
  const Problem problem = MakeProblem(testing::Bar({3, 3, 6}, 2.0, 0.2), 1);
  GradientFieldOptions options;
  options.rotation = RotationMode::kNone;
  ASSERT_OK_AND_ASSIGN(const auto plain, problem.CreateDeformer(options));
  ASSERT_OK_AND_ASSIGN(const auto propagated, problem.CreateDeformer());
  HandlePose pose;
  pose.translation_mm = {1, 2, 3};
  std::vector<HandlePose> poses = {pose};
  ASSERT_OK_AND_ASSIGN(const Deformation a, plain->Deform(poses));
  ASSERT_OK_AND_ASSIGN(const Deformation b, propagated->Deform(poses));
  EXPECT_LT(LargestDistance(a.positions, b.positions), 1e-12);

  // With a rotation the two differ, and `none` is linear in the handle's displacement.
  poses[0].rotation_vector = {0, 0, 1};
  ASSERT_OK_AND_ASSIGN(const Deformation turned, plain->Deform(poses));
  ASSERT_OK_AND_ASSIGN(const Deformation turned_field, propagated->Deform(poses));
  EXPECT_GT(LargestDistance(turned.positions, turned_field.positions), 0.1);
}

TEST(GradientFieldDeformerOracleTest, HarmonicRangeAndNegativeWeightsAreReported) {
  const Problem grid = MakeProblem(testing::Bar({3, 3, 6}), 1);
  ASSERT_OK_AND_ASSIGN(const auto deformer, grid.CreateDeformer());
  EXPECT_EQ(deformer->preparation().negative_weights, 0);
  EXPECT_GE(deformer->preparation().harmonic_min, -1e-14);
  EXPECT_LE(deformer->preparation().harmonic_max, 1 + 1e-14);
  EXPECT_GT(deformer->preparation().bytes_held, deformer->preparation().factor_bytes);
  ASSERT_OK_AND_ASSIGN(const auto tongue, TongueProblem().CreateDeformer());
  EXPECT_GT(tongue->preparation().negative_weights, 0);
}

TEST(GradientFieldDeformerErrorTest, StiffnessMustBePositiveAndOnePerTet) {
  for (const double bad : {0.0, -5.0, std::numeric_limits<double>::quiet_NaN()}) {
    Problem problem = BarProblem();
    problem.stiffness[11] = bad;
    EXPECT_THAT(problem.CreateDeformer(), StatusIs(kInvalid, HasSubstr("tet 11")));
  }
  Problem problem = BarProblem();
  problem.stiffness.conservativeResize(5);
  EXPECT_THAT(problem.CreateDeformer(), StatusIs(kInvalid, HasSubstr("5 values")));
}

TEST(GradientFieldDeformerErrorTest, InvertedTetIsRefused) {
  const Problem problem = BarProblem();
  TetIndices tets = problem.mesh->tets();
  std::swap(tets(4, 0), tets(4, 1));
  const Problem broken{
      std::make_shared<const TetMesh>(*TetMesh::Create(problem.mesh->positions(), tets)),
      problem.stiffness, problem.constraints};
  EXPECT_THAT(broken.CreateDeformer(), StatusIs(kInvalid, HasSubstr("negative volume")));
}

TEST(GradientFieldDeformerErrorTest, ComponentWithoutConstraintIsRefused) {
  const TetMesh tet = testing::SingleTet();
  Positions positions(8, 3);
  positions << tet.positions(), tet.positions().array() + 10.0;
  TetIndices tets(2, 4);
  tets << 0, 1, 2, 3, 4, 5, 6, 7;
  const auto mesh = std::make_shared<const TetMesh>(*TetMesh::Create(positions, tets));
  const Problem problem{mesh, Eigen::VectorXd::Ones(2),
                        *ConstraintSet::Create(*mesh, {0}, {{"top", {1}}})};
  EXPECT_THAT(problem.CreateDeformer(), StatusIs(kInvalid, HasSubstr("connected component 1")));
}

}  // namespace
}  // namespace tissueform
