// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/band_columns.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/pose_range.h"
#include "core/mechanics/uncertainty/uncertainty_band.h"
#include "tests/core/mechanics/uncertainty/uncertain_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::AllVertices;
using testing::Flat;
using testing::StatusIs;
using testing::UncertainBar;

Eigen::VectorXf Evaluate(const UncertainBar& bar, const std::vector<int32_t>& vertices) {
  const auto columns = BandColumns::Create(bar.Prepare(), bar.uncertainty, vertices, {});
  EXPECT_THAT(columns, testing::IsOk());
  Eigen::VectorXf band;
  (*columns)->Evaluate(bar.poses, kLargestBandRotationRad, &band);
  return band;
}

TEST(BandColumnsTest, EqualThatOfTheAnswerItself) {
  UncertainBar bar(DeformationModel::kLinearElastic);
  bar.uncertainty.poisson_ratio_95 = {0.42, 0.47};
  const std::vector<int32_t> vertices = AllVertices(bar.mesh);
  const Positions answer = bar.Solve();
  ASSERT_OK_AND_ASSIGN(
      const AnswerExpansion expansion,
      ExpandLinearElastic(bar.Prepare().get(), bar.uncertainty, Flat(answer - bar.mesh.positions()),
                          ExpansionOrder::kFirst));
  Eigen::MatrixXf fields(3 * answer.rows(), 4);
  for (int i = 0; i < 4; ++i)
    fields.col(i) = expansion.terms[static_cast<size_t>(i)].field.cast<float>();
  const Eigen::VectorXf expected = FirstOrderBand(fields);
  EXPECT_GT(expected.maxCoeff(), 0.02F);
  EXPECT_LT((Evaluate(bar, vertices) - expected).cwiseAbs().maxCoeff(), 1e-5F);
}

TEST(BandColumnsTest, ChosenVerticesKeepTheirOrder) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const Eigen::VectorXf all = Evaluate(bar, AllVertices(bar.mesh));
  const std::vector<int32_t> chosen = {70, 40, 41};
  EXPECT_LT((Evaluate(bar, chosen) - all(chosen)).cwiseAbs().maxCoeff(), 1e-7F);
}

// Within a fifth of that of full answers, though it knows no second order and no large turns.
TEST(BandColumnsTest, AreNearThoseOfTheNonlinearModel) {
  const UncertainBar bar(DeformationModel::kNeoHookean);
  const Positions answer = bar.Solve();
  ASSERT_OK_AND_ASSIGN(
      const AnswerExpansion expansion,
      ExpandNeoHookean(bar.Prepare().get(), bar.uncertainty, answer, ExpansionOrder::kSecond));
  const Eigen::VectorXd sampled =
      SampleBand(expansion, SurfaceNormals(bar.mesh, answer), /*threads=*/1).size_mm;
  const Eigen::VectorXd quick = Evaluate(bar, AllVertices(bar.mesh)).cast<double>();
  EXPECT_LT((quick - sampled).norm(), 0.2 * sampled.norm());
}

// Where linear elasticity takes a turn for strain, and where columns were not kept for it.
TEST(BandColumnsTest, TurnsBeyondTheRangeHaveNoBand) {
  UncertainBar bar(DeformationModel::kLinearElastic);
  const std::vector<int32_t> vertices = AllVertices(bar.mesh);
  ASSERT_OK_AND_ASSIGN(const auto columns,
                       BandColumns::Create(bar.Prepare(), bar.uncertainty, vertices, {}));
  const auto size_of = [&](double turn_rad, double max_rotation_rad) {
    bar.poses[0].rotation_vector = {0, turn_rad, 0};
    Eigen::VectorXf band = Eigen::VectorXf::Ones(3);
    columns->Evaluate(bar.poses, max_rotation_rad, &band);
    return band.size();
  };
  const auto all = static_cast<Eigen::Index>(vertices.size());
  EXPECT_EQ(size_of(0.3, 0.3), all) << "the edge belongs to the range";
  EXPECT_EQ(size_of(0.31, 0.3), 0);
  EXPECT_EQ(size_of(0.52, 2.5), all);
  EXPECT_EQ(size_of(0.53, 2.5), 0) << "whatever was asked for";
  EXPECT_EQ(size_of(2, 2.5), 0);
}

TEST(BandColumnsTest, IsNotMadeWhenTheAdmissionRefuses) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const auto refuse = [](int64_t) { return absl::ResourceExhaustedError("no room"); };
  EXPECT_THAT(BandColumns::Create(bar.Prepare(), bar.uncertainty, {1}, refuse),
              StatusIs(absl::StatusCode::kResourceExhausted));
}

}  // namespace
}  // namespace tissueform
