// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/rigid_registration.h"

#include <cmath>
#include <numbers>
#include <random>

#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "tests/core/mesh/generation/surfaces.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

// A closed surface without symmetry, about as large as a lower jaw: a sphere with waves.
TriangleMesh Lump(int rings) {
  Positions positions(rings * 2 * rings + 2, 3);
  TriangleIndices triangles(2 * rings * 2 * rings, 3);
  const auto place = [](double polar, double around) {
    const double radius = 40 + 10 * std::sin(3 * polar + 1) * std::cos(2 * around) +
                          8 * std::cos(polar) * std::sin(around + 0.5);
    return Eigen::RowVector3d(radius * std::sin(polar) * std::cos(around),
                              0.6 * radius * std::sin(polar) * std::sin(around),
                              1.2 * radius * std::cos(polar));
  };
  const int columns = 2 * rings;
  for (int r = 0; r < rings; ++r) {
    for (int c = 0; c < columns; ++c) {
      const double polar = std::numbers::pi * (r + 1) / (rings + 1);
      positions.row(r * columns + c) = place(polar, 2 * std::numbers::pi * c / columns);
    }
  }
  const int32_t top = rings * columns;
  positions.row(top) = place(0, 0);
  positions.row(top + 1) = place(std::numbers::pi, 0);
  Eigen::Index t = 0;
  for (int32_t c = 0; c < columns; ++c) {
    const int32_t next = (c + 1) % columns;
    triangles.row(t++) << top, c, next;
    for (int32_t r = 0; r + 1 < rings; ++r) {
      triangles.row(t++) << r * columns + c, (r + 1) * columns + c, r * columns + next;
      triangles.row(t++) << r * columns + next, (r + 1) * columns + c, (r + 1) * columns + next;
    }
    triangles.row(t++) << top + 1, (rings - 1) * columns + next, (rings - 1) * columns + c;
  }
  return *TriangleMesh::Create(positions, triangles);
}

RigidMove RandomMove(std::mt19937* random, double most_deg, double most_mm) {
  std::uniform_real_distribution<double> share(-1, 1);
  const auto vector = [&] { return Vector3d(share(*random), share(*random), share(*random)); };
  const double angle = share(*random) * most_deg * std::numbers::pi / 180;
  return {Eigen::AngleAxisd(angle, vector().normalized()).toRotationMatrix(), most_mm * vector()};
}

double ErrorMm(const RigidMove& found, const RigidMove& known) {
  return (found(Vector3d::Zero()) - known(Vector3d::Zero())).norm();
}

double ErrorDegrees(const RigidMove& found, const RigidMove& known) {
  return TurnDegrees(Composed(found, Inverse(known)));
}

TriangleMesh MovedWithNoise(const TriangleMesh& mesh, const RigidMove& move, double noise_mm,
                            std::mt19937* random) {
  std::normal_distribution<double> noise(0, noise_mm);
  Positions positions = Moved(mesh.positions(), move);
  for (double& value : positions.reshaped()) value += noise(*random);
  return *TriangleMesh::Create(positions, mesh.triangles());
}

class RegistrationOfSeedTest : public ::testing::TestWithParam<int> {};

// Other triangles, noise of 0.2 mm, and an end of the target has gone 20 mm elsewhere.
TEST_P(RegistrationOfSeedTest, FindsAKnownMoveThoughAnEndHasMovedOtherwise) {
  std::mt19937 random(static_cast<unsigned>(GetParam()));
  const RigidMove known = RandomMove(&random, 15, 15);
  const TriangleMesh fine = Lump(48);
  TriangleMesh target = MovedWithNoise(fine, known, 0.2, &random);
  Positions positions = target.positions();
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    if (fine.positions()(v, 2) < -32) positions.row(v) += Eigen::RowVector3d(0, 0, -20);
  }
  target = *TriangleMesh::Create(positions, target.triangles());
  const Registration found = SurfaceRegistration(target).Refine(SampleTriangles(Lump(37), 2000),
                                                                RigidMove(), {.keep = 0.75});
  EXPECT_LT(ErrorMm(found.move, known), 0.2);
  EXPECT_LT(ErrorDegrees(found.move, known), 0.3);
  EXPECT_LT(found.rms_mm, 0.5);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RegistrationOfSeedTest, ::testing::Range(1, 51),
                         [](const auto& seed) { return "Seed" + std::to_string(seed.param); });

Positions OutwardOf(const TriangleMesh& mesh) {
  Positions outward = Positions::Zero(mesh.num_vertices(), 3);
  for (const auto& t : mesh.triangles().rowwise()) {
    const Vector3d a = mesh.positions().row(t[0]);
    const Vector3d b = mesh.positions().row(t[1]);
    const Vector3d c = mesh.positions().row(t[2]);
    for (const int32_t v : t) outward.row(v) += (b - a).cross(c - a);
  }
  return outward.rowwise().normalized();
}

// The front of a bone, seen again by a scanner that shows all of it 0.4 mm thicker: only a fit that
// looks for the thickness does not take it for a way forward.
TEST(RigidRegistrationTest, FindsTheOffsetOfAThickerTarget) {
  std::mt19937 random(11);
  const RigidMove known = RandomMove(&random, 8, 8);
  const TriangleMesh lump = Lump(48);
  const Positions thicker = lump.positions() + 0.4 * OutwardOf(lump);
  const TriangleMesh target = *TriangleMesh::Create(Moved(thicker, known), lump.triangles());
  const OrientedPoints all = SampleTriangles(Lump(37), 3000);
  std::vector<Eigen::Index> front;
  for (Eigen::Index i = 0; i < all.points.rows(); ++i) {
    if (all.points(i, 1) < 0) front.push_back(i);
  }
  const OrientedPoints points = {all.points(front, Eigen::all), all.normals(front, Eigen::all)};
  const SurfaceRegistration registration(target);
  const Registration thick = registration.Refine(points, RigidMove(), {.target_stands_out = true});
  EXPECT_NEAR(thick.stands_out_mm, 0.4, 0.05);
  EXPECT_LT(ErrorMm(thick.move, known), 0.05);
  EXPECT_LT(thick.rms_mm, 0.1);
  const Registration thin = registration.Refine(points, RigidMove(), {});
  EXPECT_EQ(thin.stands_out_mm, 0);
  EXPECT_GT(ErrorMm(thin.move, known), 0.2);
}

TEST(RigidRegistrationTest, ReportsWhatDoesNotFit) {
  const TriangleMesh lump = Lump(30);
  Positions wide = lump.positions();
  wide.col(0) *= 1.2;
  const TriangleMesh other = *TriangleMesh::Create(wide, lump.triangles());
  const Registration found =
      SurfaceRegistration(other).Refine(SampleTriangles(lump, 1000), RigidMove(), {});
  EXPECT_GT(found.score_mm, 1);
  EXPECT_GT(found.all_rms_mm, 1);
}

TEST(RigidMoveTest, ComposingAMoveWithItsInverseIsTheIdentity) {
  std::mt19937 random(7);
  const RigidMove move = RandomMove(&random, 90, 50);
  const RigidMove none = Composed(move, Inverse(move));
  EXPECT_LT(ErrorMm(none, RigidMove()), 1e-12);
  EXPECT_LT(TurnDegrees(none), 1e-5);
}

}  // namespace
}  // namespace tissueform
