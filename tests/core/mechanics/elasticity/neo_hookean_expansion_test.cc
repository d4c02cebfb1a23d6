// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/neo_hookean_expansion.h"

#include "gtest/gtest.h"

#include "core/mechanics/elasticity/elastic_stiffness.h"
#include "core/mechanics/elasticity/neo_hookean_energy.h"
#include "tests/testing/every_instruction_set.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

constexpr double kPoissonRatio = 0.43;

// A jittered bar with tets of two stiffnesses, and forces by NeoHookeanEnergy, which CalculiX's
// answers have tested.
struct Body {
  Body()
      : mesh(testing::Bar({2, 2, 3}, 1.5, 0.2)),
        elements(ElementsOf(mesh)),
        vertex_cells(elements.cells, elements.num_vertices()),
        stiffness(Eigen::VectorXd::Constant(mesh.num_tets(), 3000.0)),
        energy(elements, vertex_cells, stiffness, kPoissonRatio, 1) {
    stiffness.tail(mesh.num_tets() / 2).setConstant(800.0);
  }
  Body(const Body&) = delete;
  Body& operator=(const Body&) = delete;

  Eigen::VectorXd Forces(const Eigen::VectorXd& field) {
    const Positions displacements =
        Eigen::Map<const Positions>(field.data(), mesh.num_vertices(), 3);
    Positions forces;
    EXPECT_EQ(energy.Evaluate(displacements, &forces).inverted_tets, 0);
    return forces.reshaped<Eigen::RowMajor>();
  }

  // The part of the forces that is even in the size: Q(u, u) with what is of fourth order.
  Eigen::VectorXd SecondDifference(const Eigen::VectorXd& field, double size) {
    return (Forces(size * field) + Forces(-size * field)) / (2 * size * size);
  }

  // The part of the forces along t v + t^2 w that is odd in t, without its linear part: the third
  // order with what is of fifth.
  Eigen::VectorXd ThirdDifference(const Eigen::VectorXd& v, const Eigen::VectorXd& w, double t) {
    const SparseMatrix K = ElasticStiffness(elements, vertex_cells, stiffness, kPoissonRatio, 1);
    const Eigen::VectorXd odd = 0.5 * (Forces(t * v + t * t * w) - Forces(-t * v + t * t * w));
    return (odd - t * (K * v)) / (t * t * t);
  }

  Eigen::MatrixXd ThirdOrder(const Eigen::MatrixXd& first, const Eigen::MatrixXd& second) const {
    return ThirdOrderForces(elements, stiffness, kPoissonRatio, first, second);
  }

  Eigen::MatrixXd SecondOrder(const Eigen::MatrixXd& fields) const {
    return SecondOrderForces(elements, stiffness, kPoissonRatio, fields);
  }

  TetMesh mesh;
  PiecewiseLinearElements elements;
  VertexCells vertex_cells;
  Eigen::VectorXd stiffness;
  NeoHookeanEnergy energy;
};

class NeoHookeanExpansionTest : public testing::EveryInstructionSet {};

INSTANTIATE_TEST_SUITE_P(On, NeoHookeanExpansionTest, testing::InstructionSets(),
                         testing::InstructionSetOf);

TEST_P(NeoHookeanExpansionTest, IsTheSecondDifferenceOfTheForces) {
  Body body;
  const Eigen::VectorXd field = 0.1 * Eigen::VectorXd::Random(3 * body.mesh.num_vertices());
  const Eigen::VectorXd second = body.SecondOrder(field);
  // What is left is of fourth order in the size, so its second difference falls with its square.
  const double far = (body.SecondDifference(field, 0.2) - second).norm();
  const double near = (body.SecondDifference(field, 0.02) - second).norm();
  EXPECT_LT(near, 2e-3 * second.norm());
  EXPECT_NEAR(far / near, 100, 20);
}

TEST_P(NeoHookeanExpansionTest, PairsAreTheSymmetricBilinearForm) {
  Body body;
  const Eigen::MatrixXd fields = 0.1 * Eigen::MatrixXd::Random(3 * body.mesh.num_vertices(), 3);
  const Eigen::MatrixXd pairs = body.SecondOrder(fields);
  ASSERT_EQ(pairs.cols(), NumFieldPairs(3));
  const Eigen::Vector3d amounts(0.7, -1.3, 0.4);
  const Eigen::VectorXd whole = body.SecondOrder(fields * amounts);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(whole.size());
  Eigen::Index pair = 0;
  for (int a = 0; a < 3; ++a) {
    for (int b = a; b < 3; ++b) {
      sum += (a == b ? 1 : 2) * amounts[a] * amounts[b] * pairs.col(pair++);
    }
  }
  EXPECT_LT((sum - whole).norm(), 1e-12 * whole.norm());
}

// Rotating by w is w x v + w x (w x v) / 2 + ...: its linear part alone strains, by second order,
// and the forces of that are those of linear elasticity for -w x (w x v) / 2.
TEST_P(NeoHookeanExpansionTest, RotationsLinearPartIsHeldByForcesOfItsStretch) {
  Body body;
  const Eigen::Vector3d w(0.3, -0.2, 0.5);
  Eigen::VectorXd linear(3 * body.mesh.num_vertices());
  Eigen::VectorXd second(linear.size());
  for (Eigen::Index v = 0; v < body.mesh.num_vertices(); ++v) {
    const Eigen::Vector3d x = body.mesh.positions().row(v);
    linear.segment<3>(3 * v) = w.cross(x);
    second.segment<3>(3 * v) = 0.5 * w.cross(w.cross(x));
  }
  constexpr double kSmall = 1e-6;
  const Eigen::VectorXd stiffness_times =
      (body.Forces(kSmall * second) - body.Forces(-kSmall * second)) / (2 * kSmall);
  EXPECT_LT((body.SecondOrder(linear) + stiffness_times).norm(), 1e-6 * stiffness_times.norm());
}

// Random fields of one size and another.
Eigen::MatrixXd RandomFields(const Body& body, Eigen::Index count) {
  return 0.1 * Eigen::MatrixXd::Random(3 * body.mesh.num_vertices(), count);
}

TEST_P(NeoHookeanExpansionTest, ThirdOrderIsTheThirdDifferenceOfTheForces) {
  Body body;
  const Eigen::VectorXd v = RandomFields(body, 1);
  const Eigen::VectorXd w = RandomFields(body, 1);
  const Eigen::VectorXd third = body.ThirdOrder(v, w);
  const double far = (body.ThirdDifference(v, w, 0.2) - third).norm();
  const double near = (body.ThirdDifference(v, w, 0.02) - third).norm();
  EXPECT_LT(near, 2e-3 * third.norm());
  EXPECT_NEAR(far / near, 100, 20);
}

// The columns by one field alone, made of several.
TEST_P(NeoHookeanExpansionTest, TriplesAreTheCubicOfAllNumbers) {
  Body body;
  const Eigen::MatrixXd first = RandomFields(body, 3);
  const Eigen::MatrixXd second = RandomFields(body, NumFieldPairs(3));
  const Eigen::MatrixXd triples = body.ThirdOrder(first, second);
  ASSERT_EQ(triples.cols(), NumFieldTriples(3));
  const Eigen::Vector3d n(0.7, -1.3, 0.4);
  Eigen::VectorXd w = Eigen::VectorXd::Zero(first.rows());
  Eigen::Index pair = 0;
  for (int a = 0; a < 3; ++a) {
    for (int b = a; b < 3; ++b) w += (a == b ? 1 : 2) * n[a] * n[b] * second.col(pair++);
  }
  const Eigen::VectorXd whole = body.ThirdOrder(first * n, w);
  EXPECT_LT((triples * TripleProducts(n) - whole).norm(), 1e-11 * whole.norm());
}

// Turning is exact: along sin R's part and (1 - cos) R's part nothing strains to third order.
TEST_P(NeoHookeanExpansionTest, RotationsHaveNoThirdOrderForces) {
  Body body;
  const Eigen::Vector3d n(0.3, -0.2, 0.5);  // sine times axis
  Eigen::VectorXd v(3 * body.mesh.num_vertices());
  Eigen::VectorXd w(v.size());
  for (Eigen::Index i = 0; i < body.mesh.num_vertices(); ++i) {
    const Eigen::Vector3d x = body.mesh.positions().row(i);
    v.segment<3>(3 * i) = n.cross(x);
    w.segment<3>(3 * i) = 0.5 * n.cross(n.cross(x));
  }
  const double alone = body.ThirdOrder(v, Eigen::VectorXd::Zero(v.size())).norm();
  EXPECT_LT(body.ThirdOrder(v, w).norm(), 1e-12 * alone);
}

}  // namespace
}  // namespace tissueform
