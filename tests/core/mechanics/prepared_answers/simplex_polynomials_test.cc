// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/simplex_polynomials.h"

#include "gtest/gtest.h"
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "core/mechanics/answer_evaluator/rotation_coefficients.h"
#include "core/mechanics/prepared_answers/rotation_expansion.h"
#include "core/mechanics/prepared_answers/vertex_response.h"
#include "tests/testing/handle_problem.h"

namespace tissueform {
namespace {

Eigen::VectorXd ValuesAt(const SimplexPolynomials& polynomials, const Eigen::VectorXd& y) {
  Eigen::VectorXd values(polynomials.num_terms());
  std::vector<double> workspace;
  polynomials.Evaluate(y, 0, absl::MakeSpan(values.data(), values.size()), &workspace);
  return values;
}

TEST(SimplexPolynomialsTest, OneDimensionGivesLegendrePolynomials) {
  const SimplexPolynomials polynomials(1, 3);
  for (const double y : {0.0, 0.3, 0.8, 1.0}) {
    const double x = 2 * y - 1;
    const Eigen::Vector4d expected(1, std::sqrt(3) * x, std::sqrt(5) * (1.5 * x * x - 0.5),
                                   std::sqrt(7) * (2.5 * x * x * x - 1.5 * x));
    EXPECT_LT((ValuesAt(polynomials, Eigen::VectorXd::Constant(1, y)) - expected).norm(), 1e-14);
  }
}

// Midpoints of a fine lattice of the triangle stand for the integral.
TEST(SimplexPolynomialsTest, TermsAreOrthonormal) {
  constexpr int kCells = 200;
  const SimplexPolynomials polynomials(2, 3);
  ASSERT_EQ(polynomials.num_terms(), 10);
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(10, 10);
  int count = 0;
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; i + j < kCells; ++j) {
      for (const double third : {1.0 / 3, 2.0 / 3}) {
        const Eigen::Vector2d y((i + third) / kCells, (j + third) / kCells);
        if (y.sum() > 1) {
          continue;
        }
        const Eigen::VectorXd values = ValuesAt(polynomials, y);
        gram += values * values.transpose();
        ++count;
      }
    }
  }
  EXPECT_LT((gram / count - Eigen::MatrixXd::Identity(10, 10)).cwiseAbs().maxCoeff(), 1e-3);
}

TEST(SimplexPolynomialsTest, InterpolationIsWellConditioned) {
  for (const auto& [dimension, degree] : {std::pair(1, 12), {2, 8}, {3, 6}, {4, 4}}) {
    const SimplexPolynomials polynomials(dimension, degree);
    EXPECT_EQ(polynomials.num_terms(), SimplexPolynomials::NumTerms(dimension, degree));
    const Eigen::MatrixXd nodes = InterpolationNodes(polynomials);
    EXPECT_GE(nodes.minCoeff(), 0);
    EXPECT_LE(nodes.rowwise().sum().maxCoeff(), 1 + 1e-14);
    Eigen::MatrixXd values(nodes.rows(), nodes.rows());
    for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
      values.row(i) = ValuesAt(polynomials, nodes.row(i));
    }
    const Eigen::VectorXd singular = values.bdcSvd().singularValues();
    EXPECT_LT(singular[0] / singular[nodes.rows() - 1], 200) << dimension << ", " << degree;
  }
}

TEST(SimplexPolynomialsTest, EnclosingSimplexHoldsValuesOutsideZeroAndOne) {
  Eigen::MatrixXd values(3, 2);
  values << -0.02, 0.5, 0.9, 0.15, 0.2, 0.2;
  const SimplexDomain domain = EnclosingSimplex(values);
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    const Eigen::VectorXd y = domain.ToUnit(values.row(i));
    EXPECT_GE(y.minCoeff(), 0);
    EXPECT_LE(y.sum(), 1 + 1e-15);
  }
  EXPECT_EQ(domain.low, Eigen::Vector2d(-0.02, 0));
}

TEST(RotationExpansionTest, ConvergesToTheRotationFieldWithinItsRemainder) {
  testing::RandomNumbers random(11);
  for (const int handles : {1, 2, 3}) {
    const SimplexDomain domain{Eigen::VectorXd::Constant(handles, -0.01), 1.03};
    const auto poses = testing::RandomPoses(handles, 0.8, 0.1, 1, &random);
    for (const int degree : {2, 4, 6}) {
      const SimplexPolynomials polynomials(handles, degree);
      PortableAnswers answers;
      DescribeExpansion(domain, polynomials, &answers);
      const std::vector<AnswerPose> answer_poses = ToAnswerPoses(poses);
      const std::vector<double> list = ExpandRotation(answers, answer_poses).coefficients;
      const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor>>
          coefficients(list.data(), polynomials.num_terms(), 9);
      const double bound = RemainderBound(answers, answer_poses, degree);
      double largest = 0;
      for (int sample = 0; sample < 200; ++sample) {
        Eigen::VectorXd y = Eigen::VectorXd::NullaryExpr(
            handles, [&](Eigen::Index) { return 0.5 + 0.5 * random.Next(); });
        y /= std::max(1.0, y.sum());
        const Eigen::VectorXd u = domain.FromUnit(y);
        Eigen::Vector3d w = Eigen::Vector3d::Zero();
        double scale = 1;
        for (int h = 0; h < handles; ++h) {
          w += u[h] * poses[h].rotation_vector;
          scale += u[h] * (poses[h].scale - 1);
        }
        const Eigen::Matrix3d expected = scale * RotationMatrix(w) - Eigen::Matrix3d::Identity();
        const Eigen::RowVectorXd sum = ValuesAt(polynomials, y).transpose() * coefficients;
        largest = std::max(
            largest,
            (expected.reshaped<Eigen::RowMajor>().transpose() - sum).reshaped(3, 3).operatorNorm());
      }
      EXPECT_LT(largest, bound) << handles << ", " << degree;
      EXPECT_GT(largest, 1e-4 * bound);
    }
  }
}

}  // namespace
}  // namespace tissueform
