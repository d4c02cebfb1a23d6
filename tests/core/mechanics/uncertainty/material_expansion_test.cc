// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/material_expansion.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/core/mechanics/uncertainty/uncertain_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::Flat;
using testing::StatusIs;
using testing::UncertainBar;

Eigen::VectorXd At(double first, double second, double third) {
  return Eigen::Vector3d(first, second, third);
}

MaterialExpansion Expand(const UncertainBar& bar, ExpansionOrder order) {
  const auto preparation = bar.Prepare();
  const Positions answer = bar.Solve();
  absl::StatusOr<MaterialExpansion> expansion =
      bar.model == DeformationModel::kNeoHookean
          ? ExpandNeoHookean(preparation.get(), bar.uncertainty, answer, order)
          : ExpandLinearElastic(preparation.get(), bar.uncertainty,
                                Flat(answer - bar.mesh.positions()), order);
  EXPECT_THAT(expansion, testing::IsOk());
  return *std::move(expansion);
}

const Eigen::MatrixXd& Field(const MaterialExpansion& expansion, int first,
                             int second = MaterialExpansion::kNone) {
  for (const auto& term : expansion.terms) {
    if (term.first == first && term.second == second) return term.field;
  }
  ADD_FAILURE() << "no term of " << first << " and " << second;
  return expansion.terms[0].field;
}

double RelativeError(const Eigen::MatrixXd& found, const Eigen::VectorXd& expected) {
  return (found - expected).norm() / expected.norm();
}

class ElasticExpansionTest : public ::testing::TestWithParam<DeformationModel> {};

// Central differences of answers in full, each with a factor of its own.
TEST_P(ElasticExpansionTest, FirstOrderEqualsDifferencesOfFullAnswers) {
  const UncertainBar bar(GetParam());
  const MaterialExpansion expansion = Expand(bar, ExpansionOrder::kFirst);
  EXPECT_EQ(expansion.variables, 3);
  for (int tissue = 0; tissue < 3; ++tissue) {
    constexpr double kStep = 0.01;
    const Eigen::VectorXd z = kStep * Eigen::Vector3d::Unit(tissue);
    const Eigen::VectorXd difference = Flat(bar.Solve(z) - bar.Solve(-z)) / (2 * kStep);
    EXPECT_LT(RelativeError(Field(expansion, tissue), difference), 1e-4) << tissue;
  }
}

INSTANTIATE_TEST_SUITE_P(Models, ElasticExpansionTest,
                         ::testing::Values(DeformationModel::kLinearElastic,
                                           DeformationModel::kNeoHookean),
                         [](const auto& test) {
                           return test.param == DeformationModel::kLinearElastic ? "LinearElastic"
                                                                                 : "NeoHookean";
                         });

TEST(MaterialExpansionTest, SecondOrderEqualsSecondDifferencesOfFullAnswers) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const MaterialExpansion expansion = Expand(bar, ExpansionOrder::kSecond);
  constexpr double kStep = 0.05;
  const Eigen::VectorXd pure =
      Flat(bar.Solve(At(kStep, 0, 0)) + bar.Solve(At(-kStep, 0, 0)) - 2 * bar.Solve()) /
      (2 * kStep * kStep);
  EXPECT_LT(RelativeError(Field(expansion, 0, 0), pure), 1e-3);
  const Eigen::VectorXd mixed =
      Flat(bar.Solve(At(kStep, 0, kStep)) + bar.Solve(At(-kStep, 0, -kStep)) -
           bar.Solve(At(kStep, 0, -kStep)) - bar.Solve(At(-kStep, 0, kStep))) /
      (4 * kStep * kStep);
  EXPECT_LT(RelativeError(Field(expansion, 0, 2), mixed), 1e-3);
}

TEST(MaterialExpansionTest, ErrorOfSecondOrderIsOfThirdOrder) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const MaterialExpansion expansion = Expand(bar, ExpansionOrder::kSecond);
  const auto error = [&](const Eigen::VectorXd& z) {
    Eigen::VectorXd sum = Flat(bar.Solve());
    for (const auto& term : expansion.terms) {
      const double other = term.second == MaterialExpansion::kNone ? 1 : z[term.second];
      sum += z[term.first] * other * term.field.col(0);
    }
    return (Flat(bar.Solve(z)) - sum).norm();
  };
  const Eigen::VectorXd z = At(0.6, -0.8, 0.5);
  EXPECT_NEAR(error(z) / error(0.5 * z), 8, 1);
}

// Scaled all alike, a body under prescribed displacements stays as it is.
TEST(MaterialExpansionTest, SensitivitiesToAllStiffnessesAtOnceSumToZero) {
  for (const DeformationModel model :
       {DeformationModel::kLinearElastic, DeformationModel::kNeoHookean}) {
    const UncertainBar bar(model);
    const MaterialExpansion expansion = Expand(bar, ExpansionOrder::kFirst);
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(3 * bar.mesh.num_vertices());
    double size = 0;
    for (int tissue = 0; tissue < 3; ++tissue) {
      sum += Field(expansion, tissue) / bar.Sigma(tissue);
      size += (Field(expansion, tissue) / bar.Sigma(tissue)).norm();
    }
    EXPECT_GT(size, 0.1);
    EXPECT_LT(sum.norm(), 1e-6 * size);
  }
}

TEST(MaterialExpansionTest, EndsOfTheRangeOfPoissonsRatioAreReachedExactly) {
  UncertainBar bar(DeformationModel::kLinearElastic);
  bar.uncertainty.poisson_ratio_95 = {0.40, 0.49};
  const MaterialExpansion expansion = Expand(bar, ExpansionOrder::kSecond);
  EXPECT_EQ(expansion.variables, 4);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(3);
  for (const int end : {0, 1}) {
    const double z = end == 0 ? -kNormal95 : kNormal95;
    const Eigen::VectorXd moved = z * Field(expansion, 3) + z * z * Field(expansion, 3, 3);
    const double ratio = bar.uncertainty.poisson_ratio_95->at(static_cast<size_t>(end));
    EXPECT_LT(RelativeError(moved, Flat(bar.Solve(rest, ratio) - bar.Solve())), 1e-9) << end;
  }
}

TEST(MaterialExpansionTest, ManyColumnsAreExpandedAsEachByItself) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const auto preparation = bar.Prepare();
  ASSERT_OK_AND_ASSIGN(const ElasticSystem* elastic, preparation->Elastic());
  const Eigen::MatrixXd& columns = elastic->response_columns();
  ASSERT_OK_AND_ASSIGN(
      const MaterialExpansion together,
      ExpandLinearElastic(preparation.get(), bar.uncertainty, columns, ExpansionOrder::kSecond));
  ASSERT_OK_AND_ASSIGN(const MaterialExpansion alone,
                       ExpandLinearElastic(preparation.get(), bar.uncertainty, columns.col(7),
                                           ExpansionOrder::kSecond));
  ASSERT_EQ(together.terms.size(), 9);
  for (size_t t = 0; t < together.terms.size(); ++t) {
    const double size = alone.terms[t].field.norm();
    EXPECT_LT((together.terms[t].field.col(7) - alone.terms[t].field).norm(), 1e-10 * size) << t;
  }
}

TEST(MaterialExpansionTest, ConstrainedVerticesAreCertain) {
  const UncertainBar bar(DeformationModel::kNeoHookean);
  const MaterialExpansion expansion = Expand(bar, ExpansionOrder::kSecond);
  for (const auto& term : expansion.terms) {
    for (const int32_t vertex : bar.constraints.constrained()) {
      EXPECT_TRUE(term.field.middleRows<3>(3 * vertex).isZero(0));
    }
  }
}

// Pressed to a third of its length a bar is about to buckle: no band is told there.
TEST(MaterialExpansionTest, WhereTheAnswerIsNotStableThereIsNoExpansion) {
  const UncertainBar bar(DeformationModel::kNeoHookean);
  Positions pressed = bar.mesh.positions();
  pressed.col(2) *= 0.3;
  EXPECT_THAT(
      ExpandNeoHookean(bar.Prepare().get(), bar.uncertainty, pressed, ExpansionOrder::kFirst),
      StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST(MaterialExpansionTest, ItCanBeCancelled) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const Cancellation cancelled([] { return true; });
  EXPECT_THAT(ExpandLinearElastic(bar.Prepare().get(), bar.uncertainty,
                                  Eigen::MatrixXd::Zero(3 * bar.mesh.num_vertices(), 1),
                                  ExpansionOrder::kFirst, cancelled),
              StatusIs(absl::StatusCode::kCancelled));
}

}  // namespace
}  // namespace tissueform
