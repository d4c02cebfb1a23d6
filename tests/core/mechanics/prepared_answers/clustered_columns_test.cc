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

  ClusteredColumns::Uses Uses(double room_mm) const {
    return {.typical = 5 * Eigen::MatrixXd::Random(kColumns, 200),
            .tried = 5 * Eigen::MatrixXd::Random(kColumns, 100),
            .room_mm = Eigen::VectorXd::Constant(100, room_mm)};
  }

  double ErrorMm(const ClusteredColumns& clustered, const Eigen::VectorXd& factors) const {
    FloatPositions answer;
    clustered.Evaluate(factors, &answer);
    const Positions exact = rest + (columns * factors).reshaped<Eigen::RowMajor>(kVertices, 3);
    return (answer.cast<double>() - exact).rowwise().norm().maxCoeff();
  }

  Positions rest;
  Eigen::MatrixXd columns;
};

TEST(ClusteredColumnsTest, EveryVertexIsAnsweredWithinTheRoomAtItsPlaceInTheAnswer) {
  const Line line;
  for (const double room : {1.0, 1e-2, 1e-4}) {
    const ClusteredColumns::Uses uses = line.Uses(room);
    const ClusteredColumns clustered(line.rest, line.columns, uses);
    for (Eigen::Index s = 0; s < uses.tried.cols(); ++s) {
      // What was cut, and as much as half of it for digits.
      EXPECT_LT(line.ErrorMm(clustered, uses.tried.col(s)), 1.5 * room + 2e-5) << room;
    }
    EXPECT_LT(line.ErrorMm(clustered, Eigen::VectorXd::Zero(kColumns)), 1e-5) << room;
  }
}

TEST(ClusteredColumnsTest, EveryClusterKeepsWhatIsUsedThere) {
  const Line line;
  const ClusteredColumns clustered(line.rest, line.columns, line.Uses(1e-2));
  EXPECT_EQ(clustered.num_vertices(), kVertices);
  EXPECT_EQ(clustered.num_columns_before(), kColumns);
  // A sixth of the line meets some 12 of the bumps.
  EXPECT_LT(clustered.num_columns(), 16);
  EXPECT_GT(clustered.num_columns(), 6);
}

TEST(ClusteredColumnsTest, DigitsGrowWithWhatIsAskedFor) {
  const Line line;
  const ClusteredColumns coarse(line.rest, line.columns, line.Uses(1e-2));
  const ClusteredColumns fine(line.rest, line.columns, line.Uses(1e-5));
  EXPECT_GT(static_cast<double>(fine.bytes_held()), 1.8 * static_cast<double>(coarse.bytes_held()));
  EXPECT_LE(fine.bytes_held(), ClusteredColumns::BytesNeeded(kVertices, kColumns));
}

TEST(ClusteredColumnsTest, NothingIsKeptWhereTheRoomIsLarge) {
  const Line line;
  const ClusteredColumns clustered(line.rest, line.columns, line.Uses(1e3));
  EXPECT_EQ(clustered.num_columns(), 0);
  FloatPositions answer;
  clustered.Evaluate(Eigen::VectorXd::Ones(kColumns), &answer);
  EXPECT_EQ(answer, line.rest.cast<float>());
}

}  // namespace
}  // namespace tissueform
