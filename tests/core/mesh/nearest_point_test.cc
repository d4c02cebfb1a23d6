// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/nearest_point.h"

#include <limits>
#include <random>

#include "gtest/gtest.h"
#include <Eigen/Geometry>

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr double kReachMm = 4;

// Triangles of mixed sizes all over a cube of 30 mm.
class NearbyTrianglesTest : public ::testing::Test {
 protected:
  NearbyTrianglesTest() : positions_(600, 3), triangles_(200, 3) {
    for (Index f = 0; f < triangles_.rows(); ++f) {
      const Vector3d middle = Anywhere(15);
      for (int k = 0; k < 3; ++k) {
        positions_.row(3 * f + k) = (middle + Anywhere(f % 5 == 0 ? 9 : 2)).transpose();
        triangles_(f, k) = static_cast<int32_t>(3 * f + k);
      }
    }
  }

  Vector3d Anywhere(double within_mm) {
    std::uniform_real_distribution<double> number(-within_mm, within_mm);
    return {number(random_), number(random_), number(random_)};
  }
  Vector3d Corner(Index f, int k) const { return positions_.row(triangles_(f, k)); }
  Vector3d Normal(Index f) const {
    return (Corner(f, 1) - Corner(f, 0)).cross(Corner(f, 2) - Corner(f, 0));
  }
  double Distance(Index f, const Vector3d& place) const {
    const Vector3d shares = NearestShares(place, Corner(f, 0), Corner(f, 1), Corner(f, 2));
    return (shares[0] * Corner(f, 0) + shares[1] * Corner(f, 1) + shares[2] * Corner(f, 2) - place)
        .norm();
  }

  std::mt19937 random_{7};
  Positions positions_;
  TriangleIndices triangles_;
};

TEST_F(NearbyTrianglesTest, NearestIsThatOfAllTriangles) {
  const NearbyTriangles nearby(positions_, triangles_, kReachMm);
  int found = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Vector3d place = Anywhere(22);
    const Vector3d normal = Anywhere(1);
    double least = std::numeric_limits<double>::infinity();
    for (Index f = 0; f < triangles_.rows(); ++f) {
      if (Normal(f).dot(normal) > 0) least = std::min(least, Distance(f, place));
    }
    const auto nearest = nearby.Nearest(place, normal);
    ASSERT_EQ(nearest.has_value(), least <= kReachMm);
    if (!nearest) continue;
    ++found;
    EXPECT_NEAR(nearest->distance_mm, least, 1e-12);
    EXPECT_GT(Normal(nearest->triangle).dot(normal), 0);
    EXPECT_NEAR(nearest->shares.sum(), 1, 1e-12);
    EXPECT_GE(nearest->shares.minCoeff(), 0);
  }
  EXPECT_GT(found, 100);
}

TEST_F(NearbyTrianglesTest, FindsNothingFarOutside) {
  const NearbyTriangles nearby(positions_, triangles_, kReachMm);
  for (const double far : {100.0, 1e6, 1e12, -1e12}) {
    EXPECT_FALSE(nearby.Nearest({far, 0, 0}, Vector3d::UnitX()).has_value());
    EXPECT_FALSE(nearby.Nearest({far, far, -far}, Vector3d::UnitX()).has_value());
  }
}

TEST_F(NearbyTrianglesTest, FindsNothingOnASurfaceWithoutTriangles) {
  const TriangleIndices none(0, 3);
  const NearbyTriangles nearby(positions_, none, kReachMm);
  EXPECT_FALSE(nearby.Nearest(Vector3d::Zero(), Vector3d::UnitX()).has_value());
}

}  // namespace
}  // namespace tissueform
