// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/elasticity/elastic_state.h"

#include <cmath>

#include "gtest/gtest.h"

#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/elasticity/elastic_stiffness.h"
#include "core/mechanics/elasticity/material.h"
#include "core/mechanics/elasticity/neo_hookean_energy.h"
#include "tests/testing/handle_problem.h"

namespace tissueform {
namespace {

constexpr double kModulusPa = 12000.0;
constexpr double kRatio = 0.42;
constexpr double kTopArea = 4.0;  // mm^2, at rest
constexpr double kToNewton = 1e-6;
const ElasticModuli kModuli = ModuliOf(kModulusPa, kRatio);

// A straight bar of 2 x 2 x 3 mm all of which is deformed by one F. Tractions on opposite sides
// cancel in the sum over a layer of vertices, so its upper end is held by P e_z times its rest
// area.
struct StretchedBar {
  StretchedBar(ElasticLaw law, const Eigen::Matrix3d& F)
      : mesh(testing::Bar({2, 2, 3})),
        state(MeasureElasticState(law, ElementsOf(mesh), mesh.positions() * F.transpose(),
                                  Eigen::VectorXd::Constant(mesh.num_tets(), kModulusPa), kRatio)) {
  }

  // In Pa of the rest area.
  Eigen::Vector3d TopTraction() const {
    const auto top = testing::SelectVertices(mesh, [](const auto& v) { return v.z() > 2.5; });
    return ResultantOf(state, top).force_n / (kTopArea * kToNewton);
  }

  TetMesh mesh;
  ElasticState state;
};

void ExpectAll(const Eigen::VectorXd& values, double expected) {
  EXPECT_LT((values.array() - expected).abs().maxCoeff(), 1e-10 * (kModulusPa + expected));
}

TEST(ElasticStateTest, LinearUniaxialStressIsItsOwnVonMisesStress) {
  const double strain = 0.01;
  const Eigen::Vector3d stretches(1 - kRatio * strain, 1 - kRatio * strain, 1 + strain);
  const StretchedBar bar(ElasticLaw::kLinear, stretches.asDiagonal());
  ExpectAll(bar.state.von_mises_pa, kModulusPa * strain);
  ExpectAll(bar.state.energy_density_pa, 0.5 * kModulusPa * strain * strain);
  EXPECT_LT((bar.TopTraction() - Eigen::Vector3d(0, 0, kModulusPa * strain)).norm(), 1e-8);
}

// Across the bar as much as lets its sides be free, found by halving.
TEST(ElasticStateTest, NeoHookeanUniaxialStressIsItsOwnVonMisesStress) {
  const double along = 1.4;
  const auto side_stress = [&](double across) {
    const double J = along * across * across;
    return kModuli.shear * std::pow(J, -5.0 / 3) * (across * across - along * along) / 3 +
           kModuli.bulk * (J - 1);
  };
  double low = 0.5;
  double high = 1.0;
  while (high - low > 1e-15) {
    const double middle = 0.5 * (low + high);
    (side_stress(middle) > 0 ? high : low) = middle;
  }
  const double J = along * low * low;
  const double stress =
      kModuli.shear * std::pow(J, -5.0 / 3) * (along * along - low * low) * 2 / 3 +
      kModuli.bulk * (J - 1);
  const StretchedBar bar(ElasticLaw::kNeoHookean, Eigen::Vector3d(low, low, along).asDiagonal());
  ExpectAll(bar.state.von_mises_pa, stress);
  EXPECT_LT((bar.TopTraction() - Eigen::Vector3d(0, 0, stress * low * low)).norm(), 1e-7);
}

TEST(ElasticStateTest, SimpleShearHasTheLawsStresses) {
  const double shear = 0.6;
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
  F(0, 2) = shear;
  const double mu = kModuli.shear;
  const StretchedBar linear(ElasticLaw::kLinear, F);
  ExpectAll(linear.state.von_mises_pa, std::sqrt(3.0) * mu * shear);
  ExpectAll(linear.state.energy_density_pa, 0.5 * mu * shear * shear);
  EXPECT_LT((linear.TopTraction() - Eigen::Vector3d(mu * shear, 0, 0)).norm(), 1e-8);
  const StretchedBar neo_hookean(ElasticLaw::kNeoHookean, F);
  ExpectAll(neo_hookean.state.von_mises_pa, mu * shear * std::sqrt(3 + shear * shear));
  ExpectAll(neo_hookean.state.energy_density_pa, 0.5 * mu * shear * shear);
  // The second one is what a plane that is held apart at its height is pressed by (Poynting).
  EXPECT_LT(
      (neo_hookean.TopTraction() - Eigen::Vector3d(mu * shear, 0, -mu * shear * shear / 3)).norm(),
      1e-8);
}

TEST(ElasticStateTest, EvenPressureHasNoVonMisesStress) {
  const double scale = 0.9;
  const Eigen::Matrix3d F = scale * Eigen::Matrix3d::Identity();
  const StretchedBar linear(ElasticLaw::kLinear, F);
  ExpectAll(linear.state.von_mises_pa, 0);
  EXPECT_NEAR(linear.TopTraction().z(), 3 * kModuli.bulk * (scale - 1), 1e-8);
  const StretchedBar neo_hookean(ElasticLaw::kNeoHookean, F);
  const double volume_change = std::pow(scale, 3) - 1;
  ExpectAll(neo_hookean.state.von_mises_pa, 0);
  ExpectAll(neo_hookean.state.energy_density_pa, 0.5 * kModuli.bulk * std::pow(volume_change, 2));
  EXPECT_NEAR(neo_hookean.TopTraction().z(), kModuli.bulk * volume_change * scale * scale, 1e-8);
}

TEST(ElasticStateTest, TurningABodyTurnsItsForcesByTheNeoHookeanLaw) {
  const Eigen::Matrix3d stretch = Eigen::Vector3d(0.8, 1.1, 1.3).asDiagonal();
  const Eigen::Matrix3d R = RotationMatrix({0.5, -2, 1});
  const StretchedBar straight(ElasticLaw::kNeoHookean, stretch);
  const StretchedBar turned(ElasticLaw::kNeoHookean, R * stretch);
  EXPECT_LT((turned.state.von_mises_pa - straight.state.von_mises_pa).norm(), 1e-8);
  EXPECT_NEAR(turned.state.strain_energy_mj, straight.state.strain_energy_mj, 1e-12);
  EXPECT_LT((turned.TopTraction() - R * straight.TopTraction()).norm(), 1e-7);
}

// One tet and a crooked bar of many stiffnesses, every vertex of which is moved at random.
struct ShakenBody {
  explicit ShakenBody(TetMesh tet_mesh)
      : mesh(std::move(tet_mesh)),
        elements(ElementsOf(mesh)),
        vertex_cells(elements.cells, elements.num_vertices()),
        stiffness(testing::MixedStiffness(mesh.num_tets())),
        displacements(mesh.num_vertices(), 3) {
    testing::RandomNumbers random(5);
    for (double& value : displacements.reshaped()) value = 0.1 * random.Next();
  }
  ElasticState State(ElasticLaw law) const {
    return MeasureElasticState(law, elements, mesh.positions() + displacements, stiffness, kRatio);
  }

  TetMesh mesh;
  PiecewiseLinearElements elements;
  VertexCells vertex_cells;
  Eigen::VectorXd stiffness;
  Positions displacements;
};

TEST(ElasticStateTest, ForcesAndEnergyAreThoseThatTheModelsMinimise) {
  for (TetMesh mesh : {testing::SingleTet(), testing::Bar({3, 2, 4}, 1.0, 0.2)}) {
    const ShakenBody body(std::move(mesh));
    NeoHookeanEnergy energy(body.elements, body.vertex_cells, body.stiffness, kRatio, 1);
    Positions gradient;
    const NeoHookeanEnergy::Value value = energy.Evaluate(body.displacements, &gradient);
    const ElasticState neo_hookean = body.State(ElasticLaw::kNeoHookean);
    EXPECT_LT((neo_hookean.forces_n - kToNewton * gradient).norm(),
              1e-12 * neo_hookean.forces_n.norm());
    EXPECT_NEAR(neo_hookean.strain_energy_mj, 1e-6 * value.energy_nj, 1e-18 * value.energy_nj);
    EXPECT_EQ(neo_hookean.points_mm, body.mesh.positions() + body.displacements);

    const SparseMatrix K =
        ElasticStiffness(body.elements, body.vertex_cells, body.stiffness, kRatio, 1);
    const Eigen::Map<const Eigen::VectorXd> d(body.displacements.data(), body.displacements.size());
    const Eigen::VectorXd Kd = K * d;
    const ElasticState linear = body.State(ElasticLaw::kLinear);
    const Eigen::Map<const Eigen::VectorXd> forces(linear.forces_n.data(), Kd.size());
    EXPECT_LT((forces - kToNewton * Kd).norm(), 1e-12 * forces.norm());
    EXPECT_NEAR(linear.strain_energy_mj, 0.5e-6 * d.dot(Kd), 1e-18 * d.dot(Kd));
    EXPECT_EQ(linear.points_mm, body.mesh.positions());
  }
}

TEST(ElasticStateTest, ForcesAndMomentsOfABodyAreInBalance) {
  for (const ElasticLaw law : {ElasticLaw::kLinear, ElasticLaw::kNeoHookean}) {
    const ShakenBody body(testing::Bar({3, 2, 4}, 1.0, 0.2));
    const ElasticState state = body.State(law);
    const Resultant whole = ResultantOf(state, testing::AllVertices(body.mesh));
    const double scale = state.forces_n.norm();
    EXPECT_LT(whole.force_n.norm(), 1e-13 * scale);
    EXPECT_LT(whole.moment_n_mm.norm(), 1e-12 * scale);
    EXPECT_NEAR(whole.about_mm.z(), state.points_mm.col(2).mean(), 1e-12);
  }
}

TEST(ElasticStateTest, ResultantIsTheSumOfForcesAndOfTheirMomentsAboutTheMeanPoint) {
  ElasticState state;
  state.points_mm = Positions{{0, 0, 0}, {4, 0, 0}, {9, 9, 9}};
  state.forces_n = Positions{{0, 1, 0}, {0, 2, 1}, {7, 7, 7}};
  const Resultant resultant = ResultantOf(state, {0, 1});
  EXPECT_EQ(resultant.force_n, Eigen::Vector3d(0, 3, 1));
  EXPECT_EQ(resultant.about_mm, Eigen::Vector3d(2, 0, 0));
  EXPECT_EQ(resultant.moment_n_mm, Eigen::Vector3d(0, -2, 2));
  EXPECT_TRUE(ResultantOf(state, {}).force_n.isZero(0));
}

TEST(ElasticStateTest, AnInvertedTetHasNoNeoHookeanStress) {
  const Eigen::Matrix3d mirror = Eigen::Vector3d(1, 1, -0.5).asDiagonal();
  const StretchedBar bar(ElasticLaw::kNeoHookean, mirror);
  EXPECT_TRUE(bar.state.von_mises_pa.array().isNaN().all());
  EXPECT_TRUE(std::isnan(bar.state.strain_energy_mj));
  EXPECT_TRUE(StretchedBar(ElasticLaw::kLinear, mirror).state.von_mises_pa.allFinite());
}

}  // namespace
}  // namespace tissueform
