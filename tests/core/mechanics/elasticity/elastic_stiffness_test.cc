// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/elastic_stiffness.h"

#include <random>

#include "gtest/gtest.h"
#include <Eigen/Eigenvalues>

#include "core/mechanics/elasticity/neo_hookean_energy.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

constexpr double kPoissonRatio = 0.4;

struct Body {
  explicit Body(TetMesh tet_mesh)
      : mesh(std::move(tet_mesh)),
        elements(ElementsOf(mesh)),
        vertex_cells(elements.cells, elements.num_vertices()),
        stiffness(Eigen::VectorXd::Constant(mesh.num_tets(), 3000.0)) {}

  SparseMatrix Stiffness(double nu = kPoissonRatio) const {
    return ElasticStiffness(elements, vertex_cells, stiffness, nu, 1);
  }
  // Forces that hold a field of displacements, #V by 3.
  Positions Forces(const Positions& displacements, double nu = kPoissonRatio) const {
    const Eigen::VectorXd forces = Stiffness(nu) * Eigen::Map<const Eigen::VectorXd>(
                                                       displacements.data(), displacements.size());
    return Eigen::Map<const Positions>(forces.data(), displacements.rows(), 3);
  }

  TetMesh mesh;
  PiecewiseLinearElements elements;
  VertexCells vertex_cells;
  Eigen::VectorXd stiffness;
};

Body UnevenBody() {
  Body body(testing::Bar({2, 3, 3}, 1.5, 0.15));
  std::mt19937 generator(5);
  for (double& value : body.stiffness) {
    value = 1000.0 + generator() % 20000;
  }
  return body;
}

TEST(ElasticStiffnessTest, IsSymmetricToTheBit) {
  const SparseMatrix K = UnevenBody().Stiffness();
  EXPECT_EQ(SparseMatrix(SparseMatrix(K.transpose()) - K).norm(), 0.0);
}

TEST(ElasticStiffnessTest, NullSpaceIsTheSixRigidMotions) {
  const SparseMatrix K = UnevenBody().Stiffness();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver{Eigen::MatrixXd(K)};
  const Eigen::VectorXd& values = solver.eigenvalues();
  const double rounding = 1e-12 * values.maxCoeff();
  EXPECT_LT(values.head<6>().cwiseAbs().maxCoeff(), rounding);
  EXPECT_GT(values[6], 1e3 * rounding);
}

TEST(ElasticStiffnessTest, RigidMotionsNeedNoForce) {
  const Body body = UnevenBody();
  const Eigen::RowVector3d shift(0.3, -2, 1), axis(0.1, 0.7, -0.4);
  Positions displacements = body.mesh.positions();
  for (auto row : displacements.rowwise()) {
    row = shift + axis.cross(Eigen::RowVector3d(row));
  }
  const double scale = body.Stiffness().coeffs().cwiseAbs().maxCoeff();
  EXPECT_LT(body.Forces(displacements).cwiseAbs().maxCoeff(), 1e-12 * scale);
}

// Stretched by e along z and free at the sides: sides come in by nu e, and the end face bears E e
// A.
TEST(ElasticStiffnessTest, UniaxialStressIsYoungsModulusTimesStrain) {
  const Body body(testing::Bar({3, 2, 4}));
  const double strain = 0.01;
  for (const double nu : {0.0, 0.3, 0.49}) {
    Positions displacements = body.mesh.positions();
    displacements.leftCols<2>() *= -nu * strain;
    displacements.col(2) *= strain;
    const Positions forces = body.Forces(displacements, nu);
    Eigen::RowVector3d top = Eigen::RowVector3d::Zero();
    for (Eigen::Index v = 0; v < forces.rows(); ++v) {
      const double z = body.mesh.positions()(v, 2);
      if (z > 3.5) {
        top += forces.row(v);
      } else if (z > 0.5) {
        EXPECT_LT(forces.row(v).norm(), 1e-9);
      }
    }
    EXPECT_NEAR(top.z(), 3000.0 * strain * 6.0, 1e-9 * 3000.0);
    EXPECT_LT(top.head<2>().norm(), 1e-9 * 3000.0);
  }
}

TEST(ElasticStiffnessTest, IsTheNeoHookeanEnergysSecondDerivativeAtRest) {
  const Body body = UnevenBody();
  const SparseMatrix K = body.Stiffness();
  NeoHookeanEnergy energy(body.elements, body.vertex_cells, body.stiffness, kPoissonRatio, 1);
  const Positions direction = Positions::Random(body.mesh.num_vertices(), 3);
  const double step = 1e-6;
  Positions plus, minus;
  energy.Evaluate(step * direction, &plus);
  energy.Evaluate(-step * direction, &minus);
  const Positions difference = (plus - minus) / (2 * step);
  EXPECT_LT((difference - body.Forces(direction)).norm(), 1e-8 * difference.norm());
}

TEST(ElasticStiffnessTest, VerticesWithoutTetsHaveEmptyColumns) {
  const TetMesh tet = testing::SingleTet();
  Positions positions(5, 3);
  positions << tet.positions(), 9.0, 9.0, 9.0;
  const SparseMatrix K = Body(TetMesh::Create(positions, tet.tets()).value()).Stiffness();
  EXPECT_EQ(K.rows(), 15);
  EXPECT_EQ(K.outerIndexPtr()[12], K.outerIndexPtr()[15]);
}

}  // namespace
}  // namespace tissueform
