// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/closest_rotation.h"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "tests/testing/every_instruction_set.h"

namespace tissueform {
namespace {

constexpr int kSize = RotationBatch::kSize;

// Numbers in [-1, 1].
class Noise {
 public:
  double operator()() { return 2.0 * generator_() / 4294967295.0 - 1.0; }
  Eigen::Matrix3d Matrix() {
    Eigen::Matrix3d matrix;
    for (double& entry : matrix.reshaped()) {
      entry = (*this)();
    }
    return matrix;
  }
  Eigen::Matrix3d Rotation(double angle) {
    const Eigen::Vector3d axis = Eigen::Vector3d((*this)(), (*this)(), (*this)()).normalized();
    return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  }

 private:
  std::mt19937 generator_{13};
};

RotationBatch Fill(const std::vector<Eigen::Matrix3d>& matrices) {
  RotationBatch batch;
  for (int k = 0; k < kSize; ++k) {
    for (int e = 0; e < 9; ++e) {
      batch.matrix[e][k] = matrices[k](e / 3, e % 3);
    }
    batch.reliable[k] = 1;
  }
  return batch;
}

Eigen::Matrix3d Lane(const RotationBatch& batch, int k) {
  Eigen::Matrix3d matrix;
  for (int e = 0; e < 9; ++e) {
    matrix(e / 3, e % 3) = batch.matrix[e][k];
  }
  return matrix;
}

TEST(ClosestRotationTest, OfARotationTimesAStretchIsThatRotation) {
  Noise noise;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Matrix3d R = noise.Rotation(3.0 * noise());
    const Eigen::Matrix3d Q = noise.Rotation(1.0);
    const Eigen::Vector3d stretches(0.3 + std::abs(noise()), 1.0, 2.0);
    const Eigen::Matrix3d S = Q * stretches.asDiagonal() * Q.transpose();
    EXPECT_LT((ClosestRotation(R * S) - R).norm(), 1e-13);
  }
}

TEST(ClosestRotationTest, NoOtherRotationIsCloserEvenToAReflection) {
  Noise noise;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Matrix3d F = noise.Matrix();  // half of these have a negative determinant
    const Eigen::Matrix3d R = ClosestRotation(F);
    EXPECT_NEAR(R.determinant(), 1, 1e-13);
    for (int j = 0; j < 200; ++j) {
      const Eigen::Matrix3d other = R * noise.Rotation(3.1 * noise());
      EXPECT_GE((other - F).norm(), (R - F).norm() - 1e-12);
    }
  }
}

TEST(RotationPowerTest, ScalesTheAngle) {
  Noise noise;
  const Eigen::Matrix3d R = noise.Rotation(0.8);
  EXPECT_LT((RotationPower(R, 3.0) - R * R * R).norm(), 1e-14);
  EXPECT_LT((RotationPower(R, 0.0) - Eigen::Matrix3d::Identity()).norm(), 1e-15);
  EXPECT_LT((RotationPower(R, -1.0) - R.transpose()).norm(), 1e-14);
}

class RotationBatchTest : public testing::EveryInstructionSet {};

INSTANTIATE_TEST_SUITE_P(On, RotationBatchTest, testing::InstructionSets(),
                         testing::InstructionSetOf);

TEST_P(RotationBatchTest, ClosestRotationsAreThoseOfTheSingularValueDecomposition) {
  Noise noise;
  int reliable = 0;
  for (int round = 0; round < 50; ++round) {
    std::vector<Eigen::Matrix3d> matrices(kSize);
    for (Eigen::Matrix3d& matrix : matrices) {
      matrix = (0.2 + round % 5) * noise.Matrix() + Eigen::Matrix3d::Identity();
    }
    RotationBatch batch = Fill(matrices);
    ClosestRotations(&batch);
    for (int k = 0; k < kSize; ++k) {
      if (batch.reliable[k] == 1.0) {
        ++reliable;
        EXPECT_LT((Lane(batch, k) - ClosestRotation(matrices[k])).norm(), 1e-12);
      } else {
        EXPECT_LE(matrices[k].determinant(), 1e-8 * std::pow(matrices[k].norm(), 3));
        EXPECT_EQ(Lane(batch, k), matrices[k]);
      }
    }
  }
  EXPECT_GT(reliable, 25 * kSize);
}

TEST_P(RotationBatchTest, VeryFlatAndVeryLargeMatricesAreStillRight) {
  Noise noise;
  std::vector<Eigen::Matrix3d> matrices(kSize);
  for (int k = 0; k < kSize; ++k) {
    const double size = std::pow(10.0, 6 * noise());
    const Eigen::Vector3d stretches(1.0, 1e-2, 1e-5);
    matrices[k] = size * noise.Rotation(2.0) * stretches.asDiagonal() * noise.Rotation(1.0);
  }
  RotationBatch batch = Fill(matrices);
  ClosestRotations(&batch);
  for (int k = 0; k < kSize; ++k) {
    ASSERT_EQ(batch.reliable[k], 1.0);
    EXPECT_LT((Lane(batch, k) - ClosestRotation(matrices[k])).norm(), 1e-9);
  }
}

TEST_P(RotationBatchTest, PowersAreThoseOfAngleAndAxis) {
  Noise noise;
  for (const double angle : {0.0, 1e-12, 1e-9, 1e-7, 1e-3, 0.5, 2.0, 3.0}) {
    std::vector<Eigen::Matrix3d> matrices(kSize);
    std::vector<double> exponents(kSize);
    for (int k = 0; k < kSize; ++k) {
      matrices[k] = noise.Rotation(angle);
      exponents[k] = std::abs(noise());
    }
    RotationBatch batch = Fill(matrices);
    RotationPowers(exponents.data(), &batch);
    for (int k = 0; k < kSize; ++k) {
      ASSERT_EQ(batch.reliable[k], 1.0);
      EXPECT_LT((Lane(batch, k) - RotationPower(matrices[k], exponents[k])).norm(), 1e-13) << angle;
    }
  }
}

TEST_P(RotationBatchTest, HalfTurnsAreLeftToTheScalarFunction) {
  Noise noise;
  const std::vector<Eigen::Matrix3d> matrices(kSize, noise.Rotation(std::numbers::pi));
  const std::vector<double> exponents(kSize, 0.5);
  RotationBatch batch = Fill(matrices);
  RotationPowers(exponents.data(), &batch);
  EXPECT_EQ(batch.reliable[0], 0.0);
  EXPECT_EQ(Lane(batch, 0), matrices[0]);
}

}  // namespace
}  // namespace tissueform
