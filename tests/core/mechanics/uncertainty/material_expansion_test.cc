// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/material_expansion.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/uncertainty/held_contact.h"
#include "tests/core/mechanics/uncertainty/uncertain_bar.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::Flat;
using ::testing::HasSubstr;
using testing::StatusIs;
using testing::UncertainBar;

Eigen::VectorXd At(double first, double second, double third) {
  return Eigen::Vector3d(first, second, third);
}

AnswerExpansion Expand(const UncertainBar& bar, ExpansionOrder order) {
  const auto preparation = bar.Prepare();
  const Positions answer = bar.Solve();
  absl::StatusOr<AnswerExpansion> expansion =
      bar.model == DeformationModel::kNeoHookean
          ? ExpandNeoHookean(preparation.get(), bar.uncertainty, answer, order)
          : ExpandLinearElastic(preparation.get(), bar.uncertainty,
                                Flat(answer - bar.mesh.positions()), order);
  EXPECT_THAT(expansion, testing::IsOk());
  return *std::move(expansion);
}

const Eigen::MatrixXd& Field(const AnswerExpansion& expansion, int first,
                             int second = AnswerExpansion::kNone) {
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
  const AnswerExpansion expansion = Expand(bar, ExpansionOrder::kFirst);
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

// A block with parted lips that are pressed together, of two tissues.
class PressedLips {
 public:
  explicit PressedLips(DeformationModel model) : model_(model), stiffness_(block_.mesh.num_tets()) {
    for (Eigen::Index t = 0; t < stiffness_.size(); ++t) {
      const bool is_upper = block_.mesh.positions()(block_.mesh.tets().row(t), 2).mean() > 2;
      uncertainty_.tissue_of_tet.push_back(is_upper ? 1 : 0);
      stiffness_[t] = is_upper ? 30000 : 10000;
    }
    uncertainty_.tissues = {{"lower", 2}, {"upper", 1.5}};
    poses_.resize(1);
    poses_[0].translation_mm = {0.1, -0.05, -0.2};
  }

  Deformation Solve(const Eigen::Vector2d& z) const {
    Eigen::VectorXd changed = stiffness_;
    for (Eigen::Index t = 0; t < changed.size(); ++t) {
      const int tissue = uncertainty_.tissue_of_tet[static_cast<size_t>(t)];
      const double factor = uncertainty_.tissues[static_cast<size_t>(tissue)].factor_95;
      changed[t] *= std::exp(std::log(factor) / kNormal95 * z[tissue]);
    }
    DeformerOptions options;
    options.model = model_;
    options.neo_hookean.tolerance = 1e-10;
    return *(*CreateDeformer(Prepare(changed), options))->Deform(poses_);
  }

  absl::StatusOr<AnswerExpansion> Expand(const Positions& answer) const {
    const bool is_nonlinear = model_ == DeformationModel::kNeoHookean;
    const SparseMatrix held =
        HeldDirections(constraints_, block_.mesh.positions(), poses_, answer, is_nonlinear);
    const auto preparation = Prepare(stiffness_);
    if (is_nonlinear) {
      return ExpandNeoHookean(preparation.get(), uncertainty_, answer, ExpansionOrder::kSecond, {},
                              &held);
    }
    return ExpandLinearElastic(preparation.get(), uncertainty_,
                               Flat(answer - block_.mesh.positions()), ExpansionOrder::kSecond, {},
                               &held);
  }

 private:
  std::shared_ptr<MeshPreparation> Prepare(const Eigen::VectorXd& stiffness) const {
    return *MeshPreparation::Create(block_.mesh, stiffness, constraints_, {});
  }

  DeformationModel model_;
  testing::PartedBlock block_;
  ConstraintSet constraints_ = block_.Constraints();
  Eigen::VectorXd stiffness_;
  MaterialUncertainty uncertainty_;
  std::vector<HandlePose> poses_;
};

TEST_P(ElasticExpansionTest, WithContactItEqualsDifferencesOfFullAnswersThatPressInTheSameRows) {
  const PressedLips lips(GetParam());
  const Deformation answer = lips.Solve({0, 0});
  const auto pressing = [](const Deformation& solved) {
    return std::ranges::count_if(solved.contact.forces, [](double force) { return force > 0; });
  };
  ASSERT_GE(pressing(answer), 3);
  ASSERT_OK_AND_ASSIGN(const AnswerExpansion expansion, lips.Expand(answer.positions));
  constexpr double kStep = 0.02;
  for (int tissue = 0; tissue < 2; ++tissue) {
    const Eigen::Vector2d z = kStep * Eigen::Vector2d::Unit(tissue);
    const Deformation stiffer = lips.Solve(z);
    const Deformation softer = lips.Solve(-z);
    ASSERT_EQ(pressing(stiffer), pressing(answer));
    ASSERT_EQ(pressing(softer), pressing(answer));
    const Eigen::VectorXd first = Flat(stiffer.positions - softer.positions) / (2 * kStep);
    EXPECT_LT(RelativeError(Field(expansion, tissue), first), 1e-4) << tissue;
    if (GetParam() != DeformationModel::kLinearElastic) continue;
    const Eigen::VectorXd second =
        Flat(stiffer.positions + softer.positions - 2 * answer.positions) / (2 * kStep * kStep);
    EXPECT_LT(RelativeError(Field(expansion, tissue, tissue), second), 1e-3) << tissue;
  }
}

TEST(MaterialExpansionTest, ContactMustBeStated) {
  const testing::PartedBlock block;
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(block.mesh.num_tets(), 10000);
  const auto preparation = *MeshPreparation::Create(block.mesh, stiffness, block.Constraints(), {});
  MaterialUncertainty uncertainty;
  uncertainty.tissues = {{"all", 2}};
  uncertainty.tissue_of_tet.assign(static_cast<size_t>(block.mesh.num_tets()), 0);
  const Eigen::MatrixXd rest = Eigen::MatrixXd::Zero(3 * block.mesh.num_vertices(), 1);
  EXPECT_THAT(
      ExpandLinearElastic(preparation.get(), uncertainty, rest, ExpansionOrder::kFirst).status(),
      StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(MaterialExpansionTest, SecondOrderEqualsSecondDifferencesOfFullAnswers) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const AnswerExpansion expansion = Expand(bar, ExpansionOrder::kSecond);
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
  const AnswerExpansion expansion = Expand(bar, ExpansionOrder::kSecond);
  const auto error = [&](const Eigen::VectorXd& z) {
    Eigen::VectorXd sum = Flat(bar.Solve());
    for (const auto& term : expansion.terms) {
      const double other = term.second == AnswerExpansion::kNone ? 1 : z[term.second];
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
    const AnswerExpansion expansion = Expand(bar, ExpansionOrder::kFirst);
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
  const AnswerExpansion expansion = Expand(bar, ExpansionOrder::kSecond);
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
      const AnswerExpansion together,
      ExpandLinearElastic(preparation.get(), bar.uncertainty, columns, ExpansionOrder::kSecond));
  ASSERT_OK_AND_ASSIGN(const AnswerExpansion alone,
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
  const AnswerExpansion expansion = Expand(bar, ExpansionOrder::kSecond);
  for (const auto& term : expansion.terms) {
    for (const int32_t vertex : bar.constraints.constrained()) {
      EXPECT_TRUE(term.field.middleRows<3>(3 * vertex).isZero(0));
    }
  }
}

// Pressed to a third of its length a bar is about to buckle: no band is given there.
TEST(MaterialExpansionTest, WhereTheAnswerIsNotStableThereIsNoExpansion) {
  const UncertainBar bar(DeformationModel::kNeoHookean);
  Positions pressed = bar.mesh.positions();
  pressed.col(2) *= 0.3;
  EXPECT_THAT(
      ExpandNeoHookean(bar.Prepare().get(), bar.uncertainty, pressed, ExpansionOrder::kFirst),
      StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("linear_elastic has one")));
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
