// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/neo_hookean_energy.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"

#include "core/mechanics/constraints/handle_pose.h"
#include "tests/testing/every_instruction_set.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

constexpr double kYoungsModulus = 3000.0;
constexpr double kPoissonRatio = 0.4;
const double kShear = kYoungsModulus / (2 * (1 + kPoissonRatio));
const double kBulk = kYoungsModulus / (3 * (1 - 2 * kPoissonRatio));

struct Body {
  explicit Body(TetMesh tet_mesh)
      : mesh(std::move(tet_mesh)),
        elements(ElementsOf(mesh)),
        vertex_cells(elements.cells, elements.num_vertices()),
        stiffness(Eigen::VectorXd::Constant(mesh.num_tets(), kYoungsModulus)),
        energy(elements, vertex_cells, stiffness, kPoissonRatio, 1) {}
  Body(const Body&) = delete;
  Body& operator=(const Body&) = delete;

  // Displacements of x = F v + t.
  Positions Displacements(const Eigen::Matrix3d& F) const {
    Positions displacements = mesh.positions() * (F - Eigen::Matrix3d::Identity()).transpose();
    displacements.rowwise() += Eigen::RowVector3d(1, -2, 0.5);
    return displacements;
  }

  TetMesh mesh;
  PiecewiseLinearElements elements;
  VertexCells vertex_cells;
  Eigen::VectorXd stiffness;
  NeoHookeanEnergy energy;
};

// Of the principal stretches a, b and c.
double Density(double a, double b, double c) {
  const double J = a * b * c;
  return kShear / 2 * (std::pow(J, -2.0 / 3) * (a * a + b * b + c * c) - 3) +
         kBulk / 2 * (J - 1) * (J - 1);
}

double Slope(const std::function<double(double)>& function, double at) {
  const double step = 1e-5;
  return (function(at + step) - function(at - step)) / (2 * step);
}

class NeoHookeanEnergyTest : public testing::EveryInstructionSet {};

INSTANTIATE_TEST_SUITE_P(On, NeoHookeanEnergyTest, testing::InstructionSets(),
                         testing::InstructionSetOf);

TEST_P(NeoHookeanEnergyTest, RigidMotionCostsNothing) {
  Body body(testing::Bar({2, 2, 3}, 1.0, 0.2));
  Positions forces;
  const auto value =
      body.energy.Evaluate(body.Displacements(RotationMatrix({0.3, -2, 1})), &forces);
  EXPECT_NEAR(value.energy_nj, 0, 1e-9);
  EXPECT_LT(forces.cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_NEAR(value.smallest_volume_ratio, 1, 1e-13);
}

TEST_P(NeoHookeanEnergyTest, RestIsExactlyZero) {
  Body body(testing::Bar({2, 2, 3}, 1.0, 0.2));
  Positions forces;
  const auto value = body.energy.Evaluate(Positions::Zero(body.mesh.num_vertices(), 3), &forces);
  EXPECT_EQ(value.energy_nj, 0);
  EXPECT_LT(forces.cwiseAbs().maxCoeff(), 1e-12);
}

TEST_P(NeoHookeanEnergyTest, HomogeneousStretchHasTheLawsDensity) {
  Body body(testing::Bar({2, 2, 3}, 1.0, 0.2));
  const Eigen::Matrix3d F = RotationMatrix({0.3, -2, 1}) *
                            Eigen::Vector3d(0.7, 1.6, 1.2).asDiagonal() * RotationMatrix({1, 1, 0});
  Positions forces;
  const auto value = body.energy.Evaluate(body.Displacements(F), &forces);
  EXPECT_NEAR(value.energy_nj / body.elements.measures.sum(), Density(0.7, 1.6, 1.2), 1e-9);
  EXPECT_NEAR(value.smallest_volume_ratio, 0.7 * 1.6 * 1.2, 1e-12);
}

TEST_P(NeoHookeanEnergyTest, GradientAgreesWithDifferences) {
  Body body(testing::Bar({2, 2, 2}, 1.0, 0.15));
  const Eigen::Index num_vertices = body.mesh.num_vertices();
  const Positions bumps = 0.1 * Positions::Random(num_vertices, 3);
  const Positions at = body.Displacements(RotationMatrix({1, 0.4, -0.6})) + bumps;
  Positions forces, unused;
  ASSERT_EQ(body.energy.Evaluate(at, &forces).inverted_tets, 0);
  for (Eigen::Index entry = 0; entry < at.size(); entry += 7) {
    const auto along = [&](double value) {
      Positions moved = at;
      moved.data()[entry] += value;
      return body.energy.Evaluate(moved, &unused).energy_nj;
    };
    EXPECT_NEAR(Slope(along, 0), forces.data()[entry], 1e-5 * forces.norm());
  }
}

// A bar stretched along z whose sides are free: the lateral stretch is where the energy is least,
// inner and side vertices bear no force, the end face bears A dW/d(stretch).
TEST_P(NeoHookeanEnergyTest, UniaxialStretchMeetsTheAnalyticAnswer) {
  Body body(testing::Bar({3, 2, 4}));
  for (const double stretch : {0.6, 1.3, 2.0}) {
    double low = 0.3, high = 2.0;
    for (int i = 0; i < 60; ++i) {
      const double middle = (low + high) / 2;
      const auto by_lateral = [&](double b) { return Density(b, b, stretch); };
      (Slope(by_lateral, middle) > 0 ? high : low) = middle;
    }
    const Eigen::Matrix3d F = Eigen::Vector3d(low, low, stretch).asDiagonal();
    Positions forces;
    body.energy.Evaluate(body.Displacements(F), &forces);
    double top = 0;
    for (Eigen::Index v = 0; v < forces.rows(); ++v) {
      const double z = body.mesh.positions()(v, 2);
      top += z > 3.5 ? forces(v, 2) : 0;
      EXPECT_LT(forces.row(v).head<2>().norm(), 1e-5 * kYoungsModulus);
      EXPECT_TRUE(z < 0.5 || z > 3.5 || std::abs(forces(v, 2)) < 1e-5 * kYoungsModulus);
    }
    const double stress = Slope([&](double a) { return Density(low, low, a); }, stretch);
    EXPECT_NEAR(top, stress * 6.0, 1e-5 * kYoungsModulus);
  }
}

TEST_P(NeoHookeanEnergyTest, SmallDisplacementsKeepTheirDigits) {
  Body body(testing::Bar({2, 2, 3}, 1.0, 0.2));
  const Positions direction = Positions::Random(body.mesh.num_vertices(), 3);
  Positions forces;
  const double large = body.energy.Evaluate(1e-4 * direction, &forces).energy_nj;
  const double small = body.energy.Evaluate(1e-8 * direction, &forces).energy_nj;
  EXPECT_NEAR(small / large, 1e-8, 1e-11);
}

TEST_P(NeoHookeanEnergyTest, InvertedTetsAreCountedAndCostInfinitelyMuch) {
  Body body(testing::Bar({2, 2, 3}));
  Positions forces;
  const Eigen::Matrix3d mirror = Eigen::Vector3d(1, 1, -1).asDiagonal();
  const auto value = body.energy.Evaluate(body.Displacements(mirror), &forces);
  EXPECT_EQ(value.inverted_tets, body.mesh.num_tets());
  EXPECT_EQ(value.energy_nj, std::numeric_limits<double>::infinity());
  EXPECT_NEAR(value.smallest_volume_ratio, -1, 1e-12);
  EXPECT_EQ(forces.size(), 0);
}

TEST_P(NeoHookeanEnergyTest, DisplacementsThatAreNotFiniteCountAsInverted) {
  Body body(testing::Bar({2, 2, 3}));
  Positions displacements = Positions::Zero(body.mesh.num_vertices(), 3);
  displacements(5, 1) = std::numeric_limits<double>::quiet_NaN();
  Positions forces;
  EXPECT_GT(body.energy.Evaluate(displacements, &forces).inverted_tets, 0);
}

}  // namespace
}  // namespace tissueform
