// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/anderson_acceleration.h"

#include <cmath>

#include "gtest/gtest.h"
#include <Eigen/LU>
#include <Eigen/QR>

namespace tissueform {
namespace {

// x <- B x + c with the spectrum of B in (0, 0.95].
struct LinearMap {
  Eigen::MatrixXd B;
  Eigen::VectorXd c;

  static LinearMap OfSize(Eigen::Index n) {
    LinearMap map;
    const Eigen::VectorXd spectrum = Eigen::VectorXd::LinSpaced(n, 0.1, 0.95);
    const Eigen::MatrixXd Q =
        Eigen::HouseholderQR<Eigen::MatrixXd>(
            Eigen::MatrixXd::NullaryExpr(n, n,
                                         [](auto i, auto j) { return std::sin(3.0 * i + i * j); }))
            .householderQ();
    map.B = Q * spectrum.asDiagonal() * Q.transpose();
    map.c = Eigen::VectorXd::LinSpaced(n, -1, 2);
    return map;
  }
  Eigen::MatrixXd operator()(const Eigen::MatrixXd& x) const { return B * x + c; }
  Eigen::MatrixXd FixedPoint() const {
    return (Eigen::MatrixXd::Identity(B.rows(), B.cols()) - B).lu().solve(c);
  }
};

int StepsToTolerance(const LinearMap& map, int depth) {
  AndersonAcceleration acceleration(depth);
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(map.c.size(), 1);
  for (int step = 1; step < 2000; ++step) {
    x = acceleration.Next(x, map(x));
    if ((x - map.FixedPoint()).norm() < 1e-8) {
      return step;
    }
  }
  return 2000;
}

TEST(AndersonAccelerationTest, DepthZeroIsThePlainIteration) {
  const LinearMap map = LinearMap::OfSize(6);
  AndersonAcceleration acceleration(0);
  Eigen::MatrixXd x = Eigen::MatrixXd::Ones(6, 1);
  for (int step = 0; step < 5; ++step) {
    const Eigen::MatrixXd image = map(x);
    EXPECT_EQ(acceleration.Next(x, image), image);
    x = image;
  }
}

// With at least as many differences as unknowns the residual can be made to vanish: n + 1 images
// suffice.
TEST(AndersonAccelerationTest, SolvesASmallLinearProblemExactly) {
  const LinearMap map = LinearMap::OfSize(4);
  EXPECT_LE(StepsToTolerance(map, 5), 6);
}

TEST(AndersonAccelerationTest, NeedsFarFewerStepsThanThePlainIteration) {
  const LinearMap map = LinearMap::OfSize(40);
  const int plain = StepsToTolerance(map, 0);
  const int accelerated = StepsToTolerance(map, 5);
  EXPECT_GT(plain, 250);
  EXPECT_LT(accelerated, plain / 4);
}

// A map whose slope changes abruptly misleads the extrapolation; it must still arrive.
TEST(AndersonAccelerationTest, RecoversFromMisleadingHistory) {
  const auto map = [](double x) { return x > 1 ? 0.9 * x : 0.5 * x - 0.3 * std::abs(x); };
  AndersonAcceleration acceleration(5);
  Eigen::MatrixXd x = Eigen::MatrixXd::Constant(1, 1, 100.0);
  for (int step = 0; step < 100; ++step) {
    x = acceleration.Next(x, Eigen::MatrixXd::Constant(1, 1, map(x(0, 0))));
  }
  EXPECT_NEAR(x(0, 0), 0, 1e-9);
}

}  // namespace
}  // namespace tissueform
