// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/tet_strain.h"

#include <cmath>

#include "gtest/gtest.h"

#include "core/mechanics/constraints/handle_pose.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

Positions Transformed(const TetMesh& mesh, const Eigen::Matrix3d& F) {
  Positions positions = mesh.positions() * F.transpose();
  positions.rowwise() += Eigen::RowVector3d(3, -5, 7);
  return positions;
}

TEST(TetStrainTest, RigidMotionHasNoStrain) {
  const TetMesh mesh = testing::Bar({2, 2, 3}, 1.0, 0.2);
  const Positions moved = Transformed(mesh, RotationMatrix({0.5, 2, -1}));
  EXPECT_LT(PrincipalGreenStrains(ElementsOf(mesh), moved, 1).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(TetStrainTest, StretchesComeOutWhateverTheRotation) {
  const TetMesh mesh = testing::Bar({2, 2, 3}, 1.0, 0.2);
  const Eigen::Vector3d stretches(0.9, 1.3, 1.1);
  const Eigen::Matrix3d F = RotationMatrix({0.5, 2, -1}) * stretches.asDiagonal() *
                            RotationMatrix({1, -0.2, 0.3}).transpose();
  const PiecewiseLinearElements elements = ElementsOf(mesh);
  const Positions moved = Transformed(mesh, F);
  EXPECT_LT((TetDeformationGradient(elements, moved, 4) - F).norm(), 1e-13);
  const PrincipalValues strains = PrincipalGreenStrains(elements, moved, 2);
  const Eigen::RowVector3d expected((1.69 - 1) / 2, (1.21 - 1) / 2, (0.81 - 1) / 2);
  EXPECT_LT((strains.rowwise() - expected).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(TetStrainTest, LogarithmicStrainsFollowFromThem) {
  const TetMesh mesh = testing::Bar({2, 2, 3}, 1.0, 0.2);
  const Eigen::Matrix3d F = RotationMatrix({0.5, 2, -1}) *
                            Eigen::Vector3d(0.5, 2.0, 1.1).asDiagonal() *
                            RotationMatrix({1, -0.2, 0.3}).transpose();
  const PrincipalValues strains = PrincipalGreenStrains(ElementsOf(mesh), Transformed(mesh, F), 1);
  const PrincipalValues logarithms = 0.5 * (2.0 * strains.array()).log1p();
  const Eigen::RowVector3d expected(std::log(2.0), std::log(1.1), -std::log(2.0));
  EXPECT_LT((logarithms.rowwise() - expected).cwiseAbs().maxCoeff(), 1e-13);
}

}  // namespace
}  // namespace tissueform
