// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/mesh/seam/seam_sheet.h"
#include "core/mesh/tet_quality.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh/validation.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;

constexpr double kSide = 20;
constexpr double kLength = 40;

// A bar of 20 by 20 by 40 mm with the vertices of its boundary first, as planning meshes have them.
struct BoundaryFirst {
  TetMesh mesh;
  Eigen::Index boundary_vertices = 0;
};
BoundaryFirst JitteredBar(uint32_t seed) {
  const TetMesh bar = testing::Bar({8, 8, 16}, 2.5, 0.2, seed);
  std::vector<int32_t> order = BoundaryVertices(bar);
  const auto boundary_vertices = static_cast<Eigen::Index>(order.size());
  const std::set<int32_t> on_boundary(order.begin(), order.end());
  for (int32_t v = 0; v < bar.num_vertices(); ++v) {
    if (!on_boundary.contains(v)) order.push_back(v);
  }
  Positions positions(bar.num_vertices(), 3);
  std::vector<int32_t> number(order.size());
  for (size_t k = 0; k < order.size(); ++k) {
    positions.row(static_cast<Eigen::Index>(k)) = bar.positions().row(order[k]);
    number[static_cast<size_t>(order[k])] = static_cast<int32_t>(k);
  }
  TetIndices tets = bar.tets();
  for (int32_t& v : tets.reshaped()) v = number[static_cast<size_t>(v)];
  return {*TetMesh::Create(std::move(positions), std::move(tets)), boundary_vertices};
}

// A plane with a wave, of which the part up to `reach_mm` along x is the sheet.
SeamSheet WavySheet(double reach_mm, double tilt = 0.15, double wave_mm = 1) {
  return {.height =
              [=](const Eigen::Vector3d& at) {
                return at.z() - kLength / 2 - tilt * at.x() - wave_mm * std::sin(at.y() / 3);
              },
          .holds = [=](const Eigen::Vector3d& at) { return at.x() < reach_mm; }};
}

double BoundaryArea(const TetMesh& mesh) {
  const TriangleIndices facets = BoundaryFacets(mesh);
  double area = 0;
  for (const auto& facet : facets.rowwise()) {
    const Eigen::Vector3d a = mesh.positions().row(facet[0]);
    const Eigen::Vector3d b = mesh.positions().row(facet[1]);
    const Eigen::Vector3d c = mesh.positions().row(facet[2]);
    area += (b - a).cross(c - a).norm() / 2;
  }
  return area;
}

double Volume(const TetMesh& mesh) { return TetVolumes(mesh.positions(), mesh.tets()).sum(); }

// Vertices that move along the edges of a rough boundary change its volume a little.
constexpr double kVolumeTolerance = 1e-3;

TEST(SeamTest, NoEdgeCrossesTheSheetAndTheBarKeepsItsShape) {
  for (uint32_t seed = 1; seed <= 20; ++seed) {
    const auto [bar, boundary_vertices] = JitteredBar(seed);
    const SeamSheet sheet = WavySheet(12);
    ASSERT_OK_AND_ASSIGN(const SeamedMesh seamed, ConformToSheet(bar, boundary_vertices, sheet));
    for (const auto& tet : seamed.mesh.tets().rowwise()) {
      for (const auto& [a, b] : kTetEdges) {
        const bool crosses = seamed.side[tet[a]] * seamed.side[tet[b]] < 0;
        const Eigen::Vector3d from = seamed.mesh.positions().row(tet[a]);
        const Eigen::Vector3d to = seamed.mesh.positions().row(tet[b]);
        EXPECT_FALSE(crosses && std::max(from.x(), to.x()) < 12);
      }
    }
    for (Eigen::Index v = 0; v < seamed.mesh.num_vertices(); ++v) {
      if (seamed.side[static_cast<size_t>(v)] != 0) continue;
      EXPECT_NEAR(sheet.height(seamed.mesh.positions().row(v)), 0, 1e-9);
    }
    EXPECT_NEAR(Volume(seamed.mesh) / Volume(bar), 1, kVolumeTolerance);
    EXPECT_TRUE(CheckTetMesh(seamed.mesh).ok());
    const std::vector<int32_t> boundary = BoundaryVertices(seamed.mesh);
    EXPECT_EQ(boundary.size(), static_cast<size_t>(seamed.boundary_vertices));
    EXPECT_EQ(boundary.back(), seamed.boundary_vertices - 1);
    EXPECT_GT(SummarizeTetQuality(seamed.mesh).min_dihedral_deg, 1.5) << seed;
  }
}

TEST(SeamTest, TheBoundaryKeepsItsNumbers) {
  const auto [bar, boundary_vertices] = JitteredBar(3);
  ASSERT_OK_AND_ASSIGN(const SeamedMesh seamed,
                       ConformToSheet(bar, boundary_vertices, WavySheet(12)));
  int64_t moved = 0;
  for (Eigen::Index v = 0; v < boundary_vertices; ++v) {
    const bool same = seamed.mesh.positions().row(v) == bar.positions().row(v);
    if (!same) ++moved;
    EXPECT_TRUE(same || seamed.side[static_cast<size_t>(v)] == 0);
  }
  EXPECT_LE(moved, seamed.num_moved);
  EXPECT_EQ(seamed.mesh.num_vertices(), bar.num_vertices() + seamed.num_added);
}

TEST(SeamTest, ASheetThroughTheWholeBarMakesTwoParts) {
  const auto [bar, boundary_vertices] = JitteredBar(1);
  ASSERT_OK_AND_ASSIGN(const SeamedMesh seamed,
                       ConformToSheet(bar, boundary_vertices, WavySheet(2 * kSide)));
  ASSERT_OK_AND_ASSIGN(const PartedMesh parted, PartMesh(seamed.mesh, seamed.side));
  EXPECT_EQ(FindConnectedComponents(parted.mesh.tets(), parted.mesh.num_vertices()).count, 2);
  // The area of the wave over the bar's section, by its slopes.
  double area = 0;
  constexpr int kSteps = 2000;
  for (int k = 0; k < kSteps; ++k) {
    const double y = (k + 0.5) * kSide / kSteps;
    area += std::sqrt(1 + 0.15 * 0.15 + std::pow(std::cos(y / 3) / 3, 2)) * kSide * kSide / kSteps;
  }
  const double grown = BoundaryArea(parted.mesh) - BoundaryArea(seamed.mesh);
  EXPECT_NEAR(grown / 2, area, 0.01 * area);  // facets are chords of the wave
}

TEST(SeamTest, TheRimWithinTheBarIsNotDoubled) {
  const auto [bar, boundary_vertices] = JitteredBar(2);
  ASSERT_OK_AND_ASSIGN(const SeamedMesh seamed,
                       ConformToSheet(bar, boundary_vertices, WavySheet(12)));
  ASSERT_OK_AND_ASSIGN(const PartedMesh parted, PartMesh(seamed.mesh, seamed.side));
  const Eigen::Index old_size = seamed.mesh.num_vertices();
  EXPECT_EQ(FindConnectedComponents(parted.mesh.tets(), parted.mesh.num_vertices()).count, 1);
  EXPECT_EQ(parted.mesh.num_vertices(),
            old_size + static_cast<Eigen::Index>(parted.original_of_double.size()));
  EXPECT_EQ(parted.mesh.positions().topRows(old_size), seamed.mesh.positions());
  std::set<int32_t> on_wall;
  for (const int32_t v : parted.wall.reshaped()) on_wall.insert(v);
  std::set<int32_t> doubled;
  for (size_t k = 0; k < parted.original_of_double.size(); ++k) {
    const int32_t original = parted.original_of_double[k];
    doubled.insert(original);
    EXPECT_TRUE(on_wall.contains(original));
    EXPECT_EQ(parted.mesh.positions().row(old_size + static_cast<Eigen::Index>(k)),
              parted.mesh.positions().row(original));
  }
  EXPECT_LT(doubled.size(), on_wall.size());  // what is not doubled is the rim
  for (const int32_t v : on_wall) {
    EXPECT_TRUE(doubled.contains(v) || parted.mesh.positions()(v, 0) > 8);
  }
  // Joined again it is the mesh before.
  TetIndices joined = parted.mesh.tets();
  for (int32_t& v : joined.reshaped()) {
    if (v >= old_size) v = parted.original_of_double[static_cast<size_t>(v - old_size)];
  }
  EXPECT_EQ(joined, seamed.mesh.tets());
}

TEST(SeamTest, OriginalsLieAboveAndTheWallFacesUp) {
  const auto [bar, boundary_vertices] = JitteredBar(4);
  ASSERT_OK_AND_ASSIGN(const SeamedMesh seamed,
                       ConformToSheet(bar, boundary_vertices, WavySheet(12)));
  ASSERT_OK_AND_ASSIGN(const PartedMesh parted, PartMesh(seamed.mesh, seamed.side));
  const Eigen::Index old_size = seamed.mesh.num_vertices();
  for (const auto& tet : parted.mesh.tets().rowwise()) {
    bool has_double = false;
    bool has_above = false;
    for (const int32_t v : tet) {
      has_double |= v >= old_size;
      has_above |= v < old_size && seamed.side[static_cast<size_t>(v)] > 0;
    }
    EXPECT_FALSE(has_double && has_above);
  }
  for (const auto& facet : parted.wall.rowwise()) {
    const Eigen::Vector3d a = parted.mesh.positions().row(facet[0]);
    const Eigen::Vector3d b = parted.mesh.positions().row(facet[1]);
    const Eigen::Vector3d c = parted.mesh.positions().row(facet[2]);
    EXPECT_GT((b - a).cross(c - a).z(), 0);
  }
}

TEST(SeamTest, VerticesThatStayJoinedAreNotDoubled) {
  const auto [bar, boundary_vertices] = JitteredBar(2);
  ASSERT_OK_AND_ASSIGN(const SeamedMesh seamed,
                       ConformToSheet(bar, boundary_vertices, WavySheet(12)));
  ASSERT_OK_AND_ASSIGN(const PartedMesh all, PartMesh(seamed.mesh, seamed.side));
  std::vector<bool> stays_joined(seamed.side.size(), false);
  const int32_t joined = all.original_of_double[all.original_of_double.size() / 2];
  stays_joined[static_cast<size_t>(joined)] = true;
  ASSERT_OK_AND_ASSIGN(const PartedMesh parted, PartMesh(seamed.mesh, seamed.side, stays_joined));
  EXPECT_EQ(parted.original_of_double.size() + 1, all.original_of_double.size());
  EXPECT_THAT(parted.original_of_double, ::testing::Not(::testing::Contains(joined)));
}

TEST(SeamTest, ASheetThatPartsNothingIsRefused) {
  const auto [bar, boundary_vertices] = JitteredBar(1);
  EXPECT_THAT(ConformToSheet(bar, boundary_vertices, WavySheet(-1)).status().message(),
              HasSubstr("the seam meets no tissue"));
  EXPECT_THAT(ConformToSheet(bar, boundary_vertices,
                             {.height = [](const Eigen::Vector3d& at) { return at.z() - 100; },
                              .holds = [](const Eigen::Vector3d& /*at*/) { return true; }})
                  .status()
                  .message(),
              HasSubstr("the seam meets no tissue"));
  // A sheet within the bar, which reaches its boundary nowhere.
  const SeamSheet inner = {
      .height = [](const Eigen::Vector3d& at) { return at.z() - kLength / 2 - 0.3; },
      .holds =
          [](const Eigen::Vector3d& at) {
            return std::hypot(at.x() - kSide / 2, at.y() - kSide / 2) < 2;
          }};
  ASSERT_OK_AND_ASSIGN(const SeamedMesh seamed, ConformToSheet(bar, boundary_vertices, inner));
  EXPECT_FALSE(PartMesh(seamed.mesh, seamed.side).ok());
}

TEST(SeamTest, RandomSheetsLeaveSoundMeshes) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto [bar, boundary_vertices] = JitteredBar(5);
  for (int trial = 0; trial < 40; ++trial) {
    const double reach_mm = 11 + 8 * uniform(random);
    const double tilt = 0.6 * uniform(random);
    const double wave_mm = 2 * uniform(random);
    ASSERT_OK_AND_ASSIGN(
        const SeamedMesh seamed,
        ConformToSheet(bar, boundary_vertices, WavySheet(reach_mm, tilt, wave_mm)));
    ASSERT_OK_AND_ASSIGN(const PartedMesh parted, PartMesh(seamed.mesh, seamed.side));
    EXPECT_TRUE(CheckTetMesh(parted.mesh).ok()) << trial;
    EXPECT_NEAR(Volume(parted.mesh) / Volume(bar), 1, kVolumeTolerance);
  }
}

}  // namespace
}  // namespace tissueform
