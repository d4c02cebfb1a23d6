// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <random>

#include "gtest/gtest.h"
#include <Eigen/Eigenvalues>

#include "core/mesh/operators/edge_laplacian.h"
#include "core/mesh/operators/gradient.h"
#include "core/mesh/operators/laplacian.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/tet_quality.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

struct MeshCase {
  std::string name;
  TetMesh (*make)();
};

void PrintTo(const MeshCase& mesh_case, std::ostream* os) { *os << mesh_case.name; }

class OperatorsTest : public ::testing::TestWithParam<MeshCase> {
 protected:
  // Between 1 and 1000 Pa, different in every tet.
  Eigen::VectorXd Stiffness() const {
    std::mt19937 generator(7);
    Eigen::VectorXd stiffness(mesh_.num_tets());
    for (double& value : stiffness) {
      value = std::pow(10.0, 3.0 * generator() / 4294967295.0);
    }
    return stiffness;
  }

  const TetMesh mesh_ = GetParam().make();
};

TEST_P(OperatorsTest, GradientOfAConstantIsZero) {
  const SparseMatrix G = Gradient(mesh_);
  const Eigen::VectorXd gradient = G * Eigen::VectorXd::Ones(mesh_.num_vertices());
  EXPECT_LT(gradient.cwiseAbs().maxCoeff(), 1e-12 * G.coeffs().abs().maxCoeff());
}

TEST_P(OperatorsTest, GradientIsExactForLinearFunctions) {
  const SparseMatrix G = Gradient(mesh_);
  const Eigen::Vector3d slope(0.3, -1.7, 2.9);
  const Eigen::VectorXd f = (mesh_.positions() * slope).array() + 5.0;
  const Eigen::VectorXd gradient = G * f;
  // Rounding of f, times the largest entry of G.
  const double rounding = 1e-15 * f.cwiseAbs().maxCoeff() * G.coeffs().abs().maxCoeff();
  for (Eigen::Index t = 0; t < mesh_.num_tets(); ++t) {
    EXPECT_LT((gradient.segment<3>(3 * t) - slope).norm(), 20 * rounding) << "tet " << t;
  }
}

TEST_P(OperatorsTest, CotangentFormulaEqualsDivergenceOfGradient) {
  const Eigen::VectorXd stiffness = Stiffness();
  const SparseMatrix from_cotangents = CotangentLaplacian(mesh_, stiffness);
  const SparseMatrix from_operators = Divergence(mesh_, stiffness) * Gradient(mesh_);
  const SparseMatrix difference = from_cotangents - from_operators;
  EXPECT_LT(difference.coeffs().abs().maxCoeff(),
            1e-12 * from_cotangents.coeffs().abs().maxCoeff());
}

TEST_P(OperatorsTest, DivergenceIsGradientTransposeTimesMass) {
  const Eigen::VectorXd stiffness = Stiffness();
  const SparseMatrix D = Divergence(mesh_, stiffness);
  // Written out from the definition, not through the matrices.
  std::mt19937 generator(11);
  Eigen::VectorXd field(3 * mesh_.num_tets());
  for (double& value : field) {
    value = 2.0 * generator() / 4294967295.0 - 1.0;
  }
  const HatGradientMatrix gradients = HatGradients(mesh_);
  const Eigen::VectorXd volumes = TetVolumes(mesh_.positions(), mesh_.tets());
  Eigen::VectorXd expected = Eigen::VectorXd::Zero(mesh_.num_vertices());
  for (Eigen::Index t = 0; t < mesh_.num_tets(); ++t) {
    for (int corner = 0; corner < 4; ++corner) {
      expected[mesh_.tets()(t, corner)] +=
          stiffness[t] * volumes[t] *
          gradients.block<1, 3>(t, 3 * corner).dot(field.segment<3>(3 * t));
    }
  }
  EXPECT_LT((D * field - expected).norm(), 1e-12 * expected.norm());
}

TEST_P(OperatorsTest, GradientsOfAnElementAreThoseOfItsTet) {
  const HatGradientMatrix expected = HatGradients(mesh_);
  const PiecewiseLinearElements elements = ElementsOf(mesh_);
  for (Eigen::Index t = 0; t < mesh_.num_tets(); ++t) {
    const Eigen::Matrix3d gradients = HatGradients<4>(elements, t);
    const Eigen::Map<const Eigen::Matrix<double, 3, 4>> of_tet(expected.row(t).data());
    EXPECT_LT((gradients - of_tet.rightCols<3>()).norm(), 1e-12 * of_tet.norm()) << "tet " << t;
  }
}

TEST_P(OperatorsTest, LaplacianIsSymmetricToTheBit) {
  const SparseMatrix L = CotangentLaplacian(mesh_, Stiffness());
  const SparseMatrix transposed = L.transpose();
  const SparseMatrix difference = L - transposed;
  EXPECT_EQ(difference.coeffs().abs().maxCoeff(), 0.0);
}

TEST_P(OperatorsTest, ConstantsLieInTheNullSpaceOfTheLaplacian) {
  const SparseMatrix L = CotangentLaplacian(mesh_, Stiffness());
  const Eigen::VectorXd product = L * Eigen::VectorXd::Ones(mesh_.num_vertices());
  EXPECT_LT(product.cwiseAbs().maxCoeff(), 1e-12 * L.coeffs().abs().maxCoeff());
}

TEST_P(OperatorsTest, EnergyOfALinearFunctionIsStiffnessTimesVolumeTimesSlopeSquared) {
  const Eigen::VectorXd stiffness = Stiffness();
  const Eigen::Vector3d slope(0.3, -1.7, 2.9);
  const Eigen::VectorXd f = mesh_.positions() * slope;
  const double energy = f.dot(CotangentLaplacian(mesh_, stiffness) * f);
  const double expected =
      stiffness.dot(TetVolumes(mesh_.positions(), mesh_.tets())) * slope.squaredNorm();
  EXPECT_NEAR(energy, expected, 1e-10 * expected);
}

TEST_P(OperatorsTest, MassMatrixHoldsStiffnessTimesVolume) {
  const Eigen::VectorXd stiffness = Stiffness();
  const Eigen::VectorXd diagonal = MassMatrix(mesh_, stiffness).diagonal();
  const Eigen::VectorXd volumes = TetVolumes(mesh_.positions(), mesh_.tets());
  for (Eigen::Index row = 0; row < diagonal.size(); ++row) {
    EXPECT_DOUBLE_EQ(diagonal[row], stiffness[row / 3] * volumes[row / 3]);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Meshes, OperatorsTest,
    ::testing::Values(
        MeshCase{"Tet", [] { return testing::SingleTet(); }},
        MeshCase{"JitteredBar",
                 [] {
                   return testing::Bar({3, 3, 6}, 2.0, 0.2);
                 }},
        MeshCase{
            "Tongue",
            [] { return testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu"); }},
        MeshCase{
            "Raptor",
            [] { return testing::LoadTestMesh("meshes/tet_sofa_raptor/raptorTetra_8418.vtu"); }}),
    [](const auto& test) { return test.param.name; });

TEST(CotangentLaplacianTest, IsPositiveSemiDefiniteWithOneNullVectorAComponent) {
  const TetMesh bar = testing::Bar({2, 2, 4}, 1.0, 0.25);
  const SparseMatrix L = CotangentLaplacian(bar, Eigen::VectorXd::Ones(bar.num_tets()));
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(L)).eigenvalues();
  const double largest = eigenvalues[eigenvalues.size() - 1];
  EXPECT_NEAR(eigenvalues[0], 0, 1e-13 * largest);
  EXPECT_GT(eigenvalues[1], 1e-4 * largest);
}

// A unit corner tet: w = 1/6 l cot(theta). The edges at the corner lie opposite to edges of length
// sqrt 2 with cot = 1 / sqrt 2, the others opposite to right angles.
TEST(CotangentWeightsTest, OfAUnitCornerAreKnownByHand) {
  Positions positions(4, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  TetIndices tets(1, 4);
  tets << 0, 1, 2, 3;
  const TetCotangentWeights weights = CotangentWeights(*TetMesh::Create(positions, tets));
  const Eigen::Matrix<double, 1, 6> expected(1.0 / 6, 1.0 / 6, 1.0 / 6, 0, 0, 0);
  EXPECT_LT((weights - expected).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(CountNegativeWeightsTest, CountsObtuseEdgesAndNotTheZerosOfAGrid) {
  const TetMesh bar = testing::Bar({3, 3, 3});
  EXPECT_EQ(CountNegativeWeights(CotangentLaplacian(bar, Eigen::VectorXd::Ones(bar.num_tets()))),
            0);
  // Vertex 3 above the middle of a flat triangle: the dihedral angles at the base are acute, those
  // at the three rising edges obtuse, so the opposite edges of the base weigh negative.
  Positions positions(4, 3);
  positions << 0, 0, 0, 4, 0, 0, 2, 3.4, 0, 2, 1.1, 0.3;
  TetIndices tets(1, 4);
  tets << 0, 1, 2, 3;
  EXPECT_EQ(CountNegativeWeights(
                CotangentLaplacian(*TetMesh::Create(positions, tets), Eigen::VectorXd::Ones(1))),
            3);
}

TEST(CotangentLaplacianTest, RowOfAnUnusedVertexIsEmpty) {
  const TetMesh raptor = testing::LoadTestMesh("meshes/tet_sofa_raptor/raptorTetra_8418.vtu");
  const SparseMatrix L = CotangentLaplacian(raptor, Eigen::VectorXd::Ones(raptor.num_tets()));
  Eigen::Index empty = 0;
  for (Eigen::Index column = 0; column < L.cols(); ++column) {
    empty += L.outerIndexPtr()[column] == L.outerIndexPtr()[column + 1] ? 1 : 0;
  }
  EXPECT_EQ(empty, 3);
}

}  // namespace
}  // namespace tissueform
