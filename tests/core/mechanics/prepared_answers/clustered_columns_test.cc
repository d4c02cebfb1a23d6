// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/clustered_columns.h"

#include <cmath>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kVertices = 700;
constexpr Eigen::Index kColumns = 40;

// Points on a line whose columns are bumps of their own along it: every place needs a few.
struct Line {
  Line() : rest(kVertices, 3), columns(3 * kVertices, kColumns) {
    const Eigen::Matrix3Xd directions = Eigen::Matrix3Xd::Random(3, kColumns);
    for (Eigen::Index v = 0; v < kVertices; ++v) {
      // Neighbours have numbers far apart.
      const double at = static_cast<double>(v * 3 % kVertices) / kVertices;
      rest.row(v) << 100 * at, 0, 0;
      for (Eigen::Index c = 0; c < kColumns; ++c) {
        const double off = (at - static_cast<double>(c) / kColumns) / 0.03;
        columns.block<3, 1>(3 * v, c) = directions.col(c) * std::exp(-off * off);
      }
    }
  }

  ClusterUses Uses(double room_mm) const {
    return {.typical = 5 * Eigen::MatrixXd::Random(kColumns, 200),
            .tried = 5 * Eigen::MatrixXd::Random(kColumns, 100),
            .room_mm = Eigen::VectorXd::Constant(100, room_mm)};
  }

  PortableAnswers Clustered(const ClusterUses& uses) const {
    PortableAnswers answers;
    const FloatPositions singles = rest.cast<float>();
    answers.free_rest.assign(singles.data(), singles.data() + singles.size());
    ClusterColumns(rest, columns, uses, &answers);
    return answers;
  }

  double ErrorMm(const PortableAnswers& clustered, const Eigen::VectorXd& factors) const {
    const FloatPositions answer = EvaluateClusters(clustered, factors);
    const Positions exact = rest + (columns * factors).reshaped<Eigen::RowMajor>(kVertices, 3);
    return (answer.cast<double>() - exact).rowwise().norm().maxCoeff();
  }

  Positions rest;
  Eigen::MatrixXd columns;
};

// The mean over the vertices.
double ColumnsOf(const PortableAnswers& answers) {
  return static_cast<double>(answers.columns.upper.size()) / (3 * kVertices);
}

TEST(ClusteredColumnsTest, EveryVertexIsAnsweredWithinTheRoomAtItsPlaceInTheAnswer) {
  const Line line;
  for (const double room : {1.0, 1e-2, 1e-4}) {
    const ClusterUses uses = line.Uses(room);
    const PortableAnswers clustered = line.Clustered(uses);
    for (Eigen::Index s = 0; s < uses.tried.cols(); ++s) {
      // What was cut, and as much as half of it for digits.
      EXPECT_LT(line.ErrorMm(clustered, uses.tried.col(s)), 1.5 * room + 2e-5) << room;
    }
    EXPECT_LT(line.ErrorMm(clustered, Eigen::VectorXd::Zero(kColumns)), 1e-5) << room;
  }
}

TEST(ClusteredColumnsTest, EveryClusterKeepsOnlyTheColumnsUsedThere) {
  const Line line;
  const PortableAnswers clustered = line.Clustered(line.Uses(1e-2));
  EXPECT_EQ(clustered.cluster_vertices.size(), size_t{kVertices});
  EXPECT_EQ(clustered.cluster_map.steps.size(), size_t{kColumns});
  // A sixth of the line meets some 12 of the bumps.
  EXPECT_LT(ColumnsOf(clustered), 16);
  EXPECT_GT(ColumnsOf(clustered), 6);
}

TEST(ClusteredColumnsTest, PrecisionGrowsWithTheRequestedAccuracy) {
  const Line line;
  const PortableAnswers coarse = line.Clustered(line.Uses(1e-2));
  const PortableAnswers fine = line.Clustered(line.Uses(1e-5));
  const auto bytes = [](const PortableAnswers& answers) {
    return static_cast<double>(sizeof(int16_t) *
                               (answers.columns.upper.size() + answers.columns.lower.size()));
  };
  EXPECT_GT(bytes(fine), 1.8 * bytes(coarse));
  EXPECT_LE(bytes(fine), static_cast<double>(ClusteredColumnsBytes(kVertices, kColumns)));
}

TEST(ClusteredColumnsTest, NothingIsKeptWhereTheRoomIsLarge) {
  const Line line;
  const PortableAnswers clustered = line.Clustered(line.Uses(1e3));
  EXPECT_EQ(ColumnsOf(clustered), 0);
  EXPECT_EQ(EvaluateClusters(clustered, Eigen::VectorXd::Ones(kColumns)), line.rest.cast<float>());
}

}  // namespace
}  // namespace tissueform
