// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/comparison.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

TEST(ComparisonTest, PercentilesAreNearestRank) {
  std::vector<double> distances(100);
  for (int i = 0; i < 100; ++i) {
    distances[i] = 100 - i;
  }
  const DistanceSummary summary = SummarizeDistances(distances);
  EXPECT_EQ(summary.count, 100);
  EXPECT_DOUBLE_EQ(summary.mean_mm, 50.5);
  EXPECT_EQ(summary.p50_mm, 50);
  EXPECT_EQ(summary.p90_mm, 90);
  EXPECT_EQ(summary.p95_mm, 95);
  EXPECT_EQ(summary.max_mm, 100);
}

TEST(ComparisonTest, OneDistanceIsEveryPercentile) {
  const DistanceSummary summary = SummarizeDistances({0.25});
  EXPECT_EQ(summary.p50_mm, 0.25);
  EXPECT_EQ(summary.p95_mm, 0.25);
}

TEST(ComparisonTest, DistancesAreEuclidean) {
  Positions a(2, 3);
  a << 0, 0, 0, 1, 1, 1;
  Positions b(2, 3);
  b << 2, 3, 6, 1, 1, 1;
  ASSERT_OK_AND_ASSIGN(const Eigen::VectorXd distances, VertexDistances(a, b));
  EXPECT_EQ(distances, Eigen::Vector2d(7, 0));
}

TEST(ComparisonTest, RegionsAreSummarisedApart) {
  const auto summaries = SummarizeDistancesByRegion(Eigen::Vector4d(1, 10, 3, 20), {5, -2, 5, -2});
  ASSERT_EQ(summaries.size(), 2u);
  EXPECT_EQ(summaries.begin()->first, -2);
  EXPECT_EQ(summaries.at(-2).mean_mm, 15);
  EXPECT_EQ(summaries.at(5).max_mm, 3);
}

TEST(ComparisonTest, DifferentMeshesAreRefused) {
  EXPECT_THAT(VertexDistances(Positions::Zero(3, 3), Positions::Zero(4, 3)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("3 vertices, the second 4")));
}

}  // namespace
}  // namespace tissueform
