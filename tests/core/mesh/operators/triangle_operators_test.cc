// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <random>

#include "gtest/gtest.h"

#include "core/mesh/operators/edge_laplacian.h"
#include "core/mesh/operators/laplacian.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/tet_topology.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

TriangleMesh TongueSurface() {
  const TetMesh tongue = testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu");
  return *TriangleMesh::Create(tongue.positions(), BoundaryFacets(tongue));
}

Eigen::VectorXd RandomStiffness(Eigen::Index size) {
  std::mt19937 generator(7);
  Eigen::VectorXd stiffness(size);
  for (double& value : stiffness) {
    value = std::pow(10.0, 3.0 * generator() / 4294967295.0);
  }
  return stiffness;
}

// Half-square: the right angle gives 0, the two 45 degree corners 1/2 each.
TEST(TriangleCotangentWeightsTest, OfAHalfSquareAreKnownByHand) {
  Positions positions(3, 3);
  positions << 0, 0, 5, 2, 0, 5, 0, 2, 5;
  TriangleIndices triangles(1, 3);
  triangles << 0, 1, 2;
  const auto weights = CotangentWeights(*TriangleMesh::Create(positions, triangles));
  EXPECT_LT((weights - Eigen::RowVector3d(0, 0.5, 0.5)).norm(), 1e-15);
}

// Sum of cotangents about an inner vertex of a flat hexagonal fan of equilateral triangles: every
// edge weighs 1/2 (cot 60 + cot 60) = 1/sqrt 3.
TEST(TriangleLaplacianTest, OfAnEquilateralFanIsKnownByHand) {
  Positions positions(7, 3);
  positions.row(0).setZero();
  TriangleIndices triangles(6, 3);
  for (int k = 0; k < 6; ++k) {
    positions.row(k + 1) << std::cos(k * M_PI / 3), std::sin(k * M_PI / 3), 0;
    triangles.row(k) << 0, k + 1, (k + 1) % 6 + 1;
  }
  const SparseMatrix L =
      CotangentLaplacian(*TriangleMesh::Create(positions, triangles), Eigen::VectorXd::Ones(6));
  EXPECT_NEAR(L.coeff(0, 0), 6 / std::sqrt(3.0), 1e-14);
  EXPECT_NEAR(L.coeff(0, 3), -1 / std::sqrt(3.0), 1e-14);
  // Linear functions are harmonic at the inner vertex.
  EXPECT_LT((L * positions).row(0).norm(), 1e-14);
}

// One a column.
Eigen::Matrix3d GradientsOfAllCorners(const PiecewiseLinearElements& elements, Eigen::Index cell) {
  const Eigen::Matrix<double, 3, 2> gradients = HatGradients<3>(elements, cell);
  Eigen::Matrix3d all;
  all << -gradients.rowwise().sum(), gradients;
  return all;
}

TEST(TriangleLaplacianTest, EqualsDivergenceOfGradientOfTheElements) {
  const TriangleMesh surface = TongueSurface();
  const Eigen::VectorXd stiffness = RandomStiffness(surface.num_triangles());
  const PiecewiseLinearElements elements = ElementsOf(surface, 1);
  std::vector<Eigen::Triplet<double, int32_t>> entries;
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    const Eigen::Matrix3d gradients = GradientsOfAllCorners(elements, f);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        entries.emplace_back(
            surface.triangles()(f, a), surface.triangles()(f, b),
            stiffness[f] * elements.measures[f] * gradients.col(a).dot(gradients.col(b)));
      }
    }
  }
  SparseMatrix from_gradients(surface.num_vertices(), surface.num_vertices());
  from_gradients.setFromTriplets(entries.begin(), entries.end());
  const SparseMatrix L = CotangentLaplacian(surface, stiffness);
  const SparseMatrix difference = L - from_gradients;
  EXPECT_LT(difference.coeffs().abs().maxCoeff(), 1e-12 * L.coeffs().abs().maxCoeff());
}

TEST(TriangleElementsTest, GradientOfALinearFunctionIsItsSlopeInThePlane) {
  const TriangleMesh surface = TongueSurface();
  const PiecewiseLinearElements elements = ElementsOf(surface, 1);
  const Eigen::Vector3d slope(0.3, -1.7, 2.9);
  const Eigen::VectorXd f = surface.positions() * slope;
  for (Eigen::Index c = 0; c < elements.num_cells(); ++c) {
    const Eigen::Vector3d values = f(elements.cells.row(c));
    const Eigen::Vector3d gradient = GradientsOfAllCorners(elements, c) * values;
    const Eigen::Vector3d normal = elements.normals.row(c);
    EXPECT_LT((gradient - (slope - slope.dot(normal) * normal)).norm(), 1e-9) << c;
  }
}

TEST(UniformLaplacianTest, CountsNeighbours) {
  const TetMesh tet = testing::SingleTet();
  const Eigen::MatrixXd L = Eigen::MatrixXd(UniformLaplacian(tet.tets(), 4, 1));
  EXPECT_EQ(L, Eigen::MatrixXd(4 * Eigen::Matrix4d::Identity() - Eigen::Matrix4d::Ones()));
}

TEST(LaplacianThreadsTest, ResultIsTheSameToTheBit) {
  const TetMesh bar = testing::Bar({12, 12, 20}, 1.0, 0.2);
  const Eigen::VectorXd stiffness = RandomStiffness(bar.num_tets());
  const SparseMatrix one = CotangentLaplacian(bar, stiffness, 1);
  const SparseMatrix three = CotangentLaplacian(bar, stiffness, 3);
  ASSERT_EQ(one.nonZeros(), three.nonZeros());
  EXPECT_EQ(Eigen::Map<const Eigen::VectorXd>(one.valuePtr(), one.nonZeros()),
            Eigen::Map<const Eigen::VectorXd>(three.valuePtr(), three.nonZeros()));
}

}  // namespace
}  // namespace tissueform
