// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/neo_hookean_tangent.h"

#include "gtest/gtest.h"
#include <Eigen/Eigenvalues>

#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/elasticity/elastic_stiffness.h"
#include "core/mechanics/elasticity/neo_hookean_energy.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

constexpr double kPoissonRatio = 0.45;

// A mesh of uneven stiffness with its energy and tangent.
struct Tissue {
  explicit Tissue(TetMesh tet_mesh)
      : mesh(std::move(tet_mesh)),
        elements(ElementsOf(mesh)),
        vertex_cells(elements.cells, elements.num_vertices()),
        stiffness(mesh.num_tets()) {
    for (Eigen::Index t = 0; t < stiffness.size(); ++t) {
      stiffness[t] = t % 3 == 0 ? 15000.0 : 3000.0;
    }
  }
  Tissue(const Tissue&) = delete;
  Tissue& operator=(const Tissue&) = delete;

  // x = F v, and bumps of so many mm.
  Positions Displacements(const Eigen::Matrix3d& F, double bumps) const {
    return mesh.positions() * (F - Eigen::Matrix3d::Identity()).transpose() +
           bumps * Positions::Random(mesh.num_vertices(), 3);
  }

  SparseMatrix Tangent(const Positions& displacements, TangentForm form) const {
    return NeoHookeanTangent(elements, vertex_cells, stiffness, kPoissonRatio, displacements, form,
                             1);
  }

  Eigen::VectorXd Gradient(const Positions& displacements) const {
    NeoHookeanEnergy energy(elements, vertex_cells, stiffness, kPoissonRatio, 1);
    Positions gradient;
    EXPECT_EQ(energy.Evaluate(displacements, &gradient).inverted_tets, 0);
    return Eigen::Map<const Eigen::VectorXd>(gradient.data(), gradient.size());
  }

  const TetMesh mesh;
  const PiecewiseLinearElements elements;
  const VertexCells vertex_cells;
  Eigen::VectorXd stiffness;
};

// Turned, drawn out along one axis, pushed together along another.
Eigen::Matrix3d LargeStrain() {
  return RotationMatrix({0.3, -2, 1}) * Eigen::Vector3d(0.6, 1.5, 1.0).asDiagonal() *
         RotationMatrix({1, 1, 0});
}

double SmallestEigenvalue(const SparseMatrix& K) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(K)).eigenvalues()[0];
}

// The true tangent times a direction against the change of the gradient along it.
void ExpectDerivativeOfTheGradient(const Tissue& tissue, const Positions& at, double size_mm) {
  const SparseMatrix K = tissue.Tangent(at, TangentForm::kTrue);
  for (int direction = 0; direction < 3; ++direction) {
    const Positions along = Positions::Random(at.rows(), 3);
    const double step = 1e-6 * size_mm;
    const Eigen::VectorXd change =
        (tissue.Gradient(at + step * along) - tissue.Gradient(at - step * along)) / (2 * step);
    const Eigen::VectorXd product =
        K * Eigen::Map<const Eigen::VectorXd>(along.data(), along.size());
    EXPECT_LT((product - change).norm(), 1e-6 * change.norm());
  }
}

TEST(NeoHookeanTangentTest, IsTheDerivativeOfTheGradientOfOneTet) {
  const Tissue tissue(testing::SingleTet());
  ExpectDerivativeOfTheGradient(tissue, tissue.Displacements(LargeStrain(), 0), 1.0);
}

TEST(NeoHookeanTangentTest, IsTheDerivativeOfTheGradientOfAJitteredBar) {
  const Tissue tissue(testing::Bar({3, 2, 4}, 1.0, 0.2));
  ExpectDerivativeOfTheGradient(tissue, tissue.Displacements(LargeStrain(), 0.05), 1.0);
}

TEST(NeoHookeanTangentTest, IsTheDerivativeOfTheGradientOfTheTongue) {
  const Tissue tissue(testing::LoadTestMesh("plans/tongue/volumetricTongue.vtu"));
  // Its smallest tets are a few thousandths wide.
  ExpectDerivativeOfTheGradient(tissue, tissue.Displacements(LargeStrain(), 0), 0.01);
}

TEST(NeoHookeanTangentTest, AtRestItIsTheLinearStiffness) {
  const Tissue tissue(testing::Bar({3, 2, 4}, 1.0, 0.2));
  const SparseMatrix K =
      ElasticStiffness(tissue.elements, tissue.vertex_cells, tissue.stiffness, kPoissonRatio, 1);
  const Positions rest = Positions::Zero(tissue.mesh.num_vertices(), 3);
  for (const TangentForm form : {TangentForm::kTrue, TangentForm::kPositive}) {
    const SparseMatrix tangent = tissue.Tangent(rest, form);
    ASSERT_EQ(tangent.nonZeros(), K.nonZeros());
    EXPECT_LT((tangent - K).norm(), 1e-12 * K.norm());
  }
}

TEST(NeoHookeanTangentTest, PositiveFormHasNoNegativeEigenvalueWhereTheTrueOneHas) {
  const Tissue tissue(testing::Bar({2, 2, 2}, 1.0, 0.15));
  const Positions at = tissue.Displacements(LargeStrain(), 0.1);
  const double size = tissue.Tangent(at, TangentForm::kPositive).norm();
  EXPECT_GT(SmallestEigenvalue(tissue.Tangent(at, TangentForm::kPositive)), -1e-12 * size);
  EXPECT_LT(SmallestEigenvalue(tissue.Tangent(at, TangentForm::kTrue)), -1e-6 * size);
}

TEST(NeoHookeanTangentTest, PositiveFormIsTheTrueOneWhereThatIsPositive) {
  const Tissue tissue(testing::Bar({3, 2, 4}, 1.0, 0.15));
  const Eigen::Matrix3d F =
      RotationMatrix({0.3, -2, 1}) * Eigen::Vector3d(1.04, 1.03, 1.02).asDiagonal();
  const Positions at = tissue.Displacements(F, 0);
  const SparseMatrix positive = tissue.Tangent(at, TangentForm::kPositive);
  EXPECT_LT((positive - tissue.Tangent(at, TangentForm::kTrue)).norm(), 1e-14 * positive.norm());
}

TEST(NeoHookeanTangentTest, PositiveFormIsNeverBelowTheTrueOne) {
  const Tissue tissue(testing::SingleTet());
  const Positions at = tissue.Displacements(LargeStrain(), 0);
  const SparseMatrix positive = tissue.Tangent(at, TangentForm::kPositive);
  const SparseMatrix difference = positive - tissue.Tangent(at, TangentForm::kTrue);
  EXPECT_GT(difference.norm(), 1e-3 * positive.norm());
  EXPECT_GT(SmallestEigenvalue(difference), -1e-12 * positive.norm());
}

}  // namespace
}  // namespace tissueform
