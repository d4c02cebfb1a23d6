// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The `estimated` mode of the gradient-field deformer, on tets.

#include <cmath>
#include <numbers>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/closest_rotation.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mesh/operators/gradient.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::LargestDistance;
using testing::StatusIs;

GradientFieldOptions Estimated(BlendMap blend = BlendMap::kCosine, int depth = 5,
                               double tolerance_mm = 1e-6, int max_iterations = 200) {
  GradientFieldOptions options;
  options.rotation = RotationMode::kEstimated;
  options.blend = blend;
  options.acceleration_depth = depth;
  options.tolerance_mm = tolerance_mm;
  options.max_iterations = max_iterations;
  return options;
}

// A bar along z, held at one end, the other end shifted across: the source's Figs. 3 and 4.
class EstimatedRotationTest : public ::testing::Test {
 protected:
  absl::StatusOr<std::unique_ptr<Deformer>> Create(const GradientFieldOptions& options) const {
    return CreateGradientFieldDeformer(bar_, stiffness_, ends_, options);
  }
  absl::StatusOr<Deformation> Deform(const GradientFieldOptions& options) const {
    auto deformer = Create(options);
    return deformer.ok() ? (*deformer)->Deform(poses_) : deformer.status();
  }

  const TetMesh bar_ = testing::Bar({4, 4, 16}, 1.0, 0.1);
  const ConstraintSet ends_ = testing::BarEnds(bar_, 0.3);
  const Eigen::VectorXd stiffness_ = Eigen::VectorXd::Constant(bar_.num_tets(), 15000.0);
  const std::vector<HandlePose> poses_ = [] {
    HandlePose pose;
    pose.translation_mm = {0, 5, 0};
    return std::vector<HandlePose>{pose};
  }();
};

TEST(BlendWeightsTest, AreTheSourcesFormulasForOneHandle) {
  CellField s(5, 1);
  s << 0.0, 0.1, 0.5, 0.8, 1.0;
  const Eigen::VectorXd linear = BlendWeights(s, BlendMap::kLinear);
  const Eigen::VectorXd cosine = BlendWeights(s, BlendMap::kCosine);
  for (Eigen::Index c = 0; c < s.rows(); ++c) {
    EXPECT_NEAR(linear[c], 1 - 2 * std::abs(s(c, 0) - 0.5), 1e-15);
    EXPECT_NEAR(cosine[c], std::cos(std::numbers::pi * std::abs(s(c, 0) - 0.5)), 1e-15);
  }
  EXPECT_EQ(BlendWeights(s, BlendMap::kUnblended), Eigen::VectorXd::Ones(5));
}

TEST(BlendWeightsTest, StayInTheUnitIntervalWhereHarmonicFieldsLeaveIt) {
  CellField u(3, 2);
  u << 1.2, -0.1, 0.2, 0.2, -0.3, 0.1;
  for (const BlendMap map : {BlendMap::kLinear, BlendMap::kCosine}) {
    const Eigen::VectorXd weights = BlendWeights(u, map);
    EXPECT_GE(weights.minCoeff(), 0);
    EXPECT_LE(weights.maxCoeff(), 1);
  }
}

// One iteration written out with the scalar functions, tet by tet, against the deformer's batches.
TEST_F(EstimatedRotationTest, LocalStepIsTheSourcesFormulaTetByTet) {
  ASSERT_OK_AND_ASSIGN(const Deformation bent, Deform(Estimated()));
  const HatGradientMatrix gradients = HatGradients(bar_);
  const Eigen::VectorXd weights = Eigen::VectorXd::LinSpaced(bar_.num_tets(), 0.0, 1.0);
  CellTransforms transforms;
  EstimateRotations(ElementsOf(bar_), bent.positions, weights, {}, 1, &transforms);
  for (Eigen::Index t = 0; t < bar_.num_tets(); ++t) {
    Eigen::Matrix3d F = Eigen::Matrix3d::Zero();
    for (int corner = 0; corner < 4; ++corner) {
      F += bent.positions.row(bar_.tets()(t, corner)).transpose() *
           gradients.block<1, 3>(t, 3 * corner);
    }
    const Eigen::Matrix3d expected = RotationPower(ClosestRotation(F), weights[t]);
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> actual(
        transforms.row(t).data());
    EXPECT_LT((actual - expected).norm(), 1e-12) << "tet " << t;
  }
}

TEST_F(EstimatedRotationTest, PropagatedTransformIsBlendedWithTheEstimate) {
  // P exp(h log(P^-1 R)) ends at P for h = 0 and at R (times s^0) for h = 1.
  const Eigen::Matrix3d Q = RotationMatrix({0.3, 0.2, -0.5});
  CellTransforms propagated(bar_.num_tets(), 9);
  for (Eigen::Index t = 0; t < bar_.num_tets(); ++t) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(propagated.row(t).data()) = 1.5 * Q;
  }
  const Eigen::Matrix3d R = RotationMatrix({-0.4, 0.1, 0.9});
  const Positions turned = bar_.positions() * R.transpose();
  const PiecewiseLinearElements elements = ElementsOf(bar_);
  for (const double h : {0.0, 0.25, 1.0}) {
    const Eigen::VectorXd weights = Eigen::VectorXd::Constant(bar_.num_tets(), h);
    CellTransforms blended;
    EstimateRotations(elements, turned, weights, propagated, 1, &blended);
    const Eigen::Matrix3d expected = std::pow(1.5, 1 - h) * Q * RotationPower(Q.transpose() * R, h);
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> actual(
        blended.row(7).data());
    EXPECT_LT((actual - expected).norm(), 1e-12) << h;
  }
}

TEST_F(EstimatedRotationTest, AcceleratedAndPlainIterationReachTheSameFixedPoint) {
  for (const BlendMap blend : {BlendMap::kLinear, BlendMap::kCosine}) {
    ASSERT_OK_AND_ASSIGN(const Deformation plain, Deform(Estimated(blend, 0, 1e-9)));
    ASSERT_OK_AND_ASSIGN(const Deformation accelerated, Deform(Estimated(blend, 5, 1e-9)));
    EXPECT_TRUE(plain.summary.converged);
    EXPECT_TRUE(accelerated.summary.converged);
    EXPECT_LT(accelerated.summary.iterations, plain.summary.iterations);
    EXPECT_LT(LargestDistance(plain.positions, accelerated.positions), 1e-7);
  }
}

// On a bar with the proportions of the source's fifth, as the benchmark does on the whole one.
TEST_F(EstimatedRotationTest, TenSolvesComeWithinAThousandthOfTheDisplacement) {
  const TetMesh bar = testing::Bar({5, 5, 10});
  const ConstraintSet ends = testing::BarEnds(bar);
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Ones(bar.num_tets());
  std::vector<HandlePose> poses(1);
  poses[0].translation_mm = {0, 3, 0};
  Positions answers[2];
  for (const int max_iterations : {10, 200}) {
    ASSERT_OK_AND_ASSIGN(
        const auto deformer,
        CreateGradientFieldDeformer(bar, stiffness, ends,
                                    Estimated(BlendMap::kCosine, 5, 1e-9, max_iterations)));
    ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
    EXPECT_EQ(result.summary.converged, max_iterations == 200);
    answers[max_iterations == 200] = result.positions;
  }
  EXPECT_LT(LargestDistance(answers[0], answers[1]), 1e-3 * 3);
}

TEST_F(EstimatedRotationTest, BlendingBendsTheBarAwayFromThePlainShear) {
  GradientFieldOptions plain_options;
  plain_options.rotation = RotationMode::kNone;
  ASSERT_OK_AND_ASSIGN(const Deformation plain, Deform(plain_options));
  ASSERT_OK_AND_ASSIGN(const Deformation blended, Deform(Estimated()));
  EXPECT_GT(LargestDistance(blended.positions, plain.positions), 0.5);
  EXPECT_EQ(MeasureDeformation(bar_, blended.positions).inverted_tets, 0);
}

TEST_F(EstimatedRotationTest, HistoryEndsUnderTheTolerance) {
  ASSERT_OK_AND_ASSIGN(const Deformation result, Deform(Estimated(BlendMap::kCosine, 5, 1e-3)));
  ASSERT_EQ(result.summary.changes_mm.size(), static_cast<size_t>(result.summary.iterations - 1));
  EXPECT_LE(result.summary.changes_mm.back(), 1e-3);
  EXPECT_GT(result.summary.changes_mm.front(), 1e-3);
}

TEST_F(EstimatedRotationTest, OptionsOutOfRangeAreRefused) {
  EXPECT_THAT(Deform(Estimated(BlendMap::kCosine, 5, 0)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("tolerance_mm")));
  EXPECT_THAT(Deform(Estimated(BlendMap::kCosine, 5, 1, 0)),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("max_iterations")));
}

TEST_F(EstimatedRotationTest, UniformGuidanceOnAGradedBarIsWorseThanCotangents) {
  // Cells of the lower half are three times as high: harmonic fields of uniform weights see only
  // the numbers.
  Positions graded = testing::Bar({3, 3, 12}).positions();
  for (Eigen::Index v = 0; v < graded.rows(); ++v) {
    const double z = graded(v, 2);
    graded(v, 2) = z <= 6 ? 3 * z : 18 + (z - 6);
  }
  ASSERT_OK_AND_ASSIGN(const TetMesh bar, TetMesh::Create(graded, testing::Bar({3, 3, 12}).tets()));
  const ConstraintSet ends = testing::BarEnds(bar);
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Ones(bar.num_tets());
  HandlePose pose;
  pose.pivot_mm = {1.5, 1.5, 0};
  pose.rotation_vector = {0, 0, std::numbers::pi};
  const std::vector<HandlePose> twist = {pose};
  double smallest_ratio[2];
  for (const Guidance guidance : {Guidance::kCotangent, Guidance::kUniform}) {
    GradientFieldOptions options;
    options.guidance = guidance;
    ASSERT_OK_AND_ASSIGN(const auto deformer,
                         CreateGradientFieldDeformer(bar, stiffness, ends, options));
    ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(twist));
    smallest_ratio[static_cast<int>(guidance)] =
        MeasureDeformation(bar, result.positions).min_volume_ratio;
  }
  EXPECT_GT(smallest_ratio[0], smallest_ratio[1] + 0.01);
}

}  // namespace
}  // namespace tissueform
