// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/arap_deformer.h"

#include <numbers>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mechanics/deformation/rotation_fit.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::LargestDistance;
using testing::RandomNumbers;
using testing::RandomPoses;
using testing::StatusIs;

TetMesh JitteredBar() { return testing::Bar({4, 6, 8}, 2.0, 0.2); }

double EnergyOf(const MeshPreparation& preparation, const Positions& positions) {
  CellTransforms rotations;
  return FitRotations(preparation.elements(), preparation.stiffness(),
                      positions - preparation.mesh().positions(), 1, &rotations);
}

TEST(ArapDeformerTest, EnergyNeverRises) {
  RandomNumbers random(1);
  for (const int depth : {0, 5}) {
    for (const int num_handles : {1, 3}) {
      const auto preparation = testing::PrepareMesh(JitteredBar(), num_handles);
      ArapOptions options;
      options.acceleration_depth = depth;
      options.tolerance_mm = 1e-9;  // down to rounding
      options.max_iterations = 300;
      ASSERT_OK_AND_ASSIGN(const auto deformer, CreateArapDeformer(preparation, options));
      for (const double angle : {0.0, 0.5, 1.5, 3.0}) {
        const auto poses = RandomPoses(num_handles, angle, 0.2, 20, &random);
        ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(poses));
        const std::vector<double>& energies = result.summary.energies_nj;
        ASSERT_EQ(energies.size(), result.summary.changes_mm.size() + 1);
        for (size_t i = 1; i < energies.size(); ++i) {
          EXPECT_LE(energies[i], energies[i - 1]) << "iteration " << i;
        }
        EXPECT_NEAR(energies.back(), EnergyOf(*preparation, result.positions),
                    1e-9 * energies.back());
      }
    }
  }
}

TEST(ArapDeformerTest, IdentityGivesRestExactly) {
  const auto preparation = testing::PrepareMesh(JitteredBar(), 3);
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateArapDeformer(preparation, {}));
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(std::vector<HandlePose>(3)));
  EXPECT_LT(LargestDistance(result.positions, preparation->mesh().positions()), 1e-12);
  EXPECT_TRUE(result.summary.converged);
  EXPECT_LT(result.summary.energies_nj.back(), 1e-12);
}

// Every cross-section of a bar turns by its share, in both directions.
TEST(ArapDeformerTest, HalfAndWholeTwistsAreFollowed) {
  const TetMesh bar = testing::Bar({4, 4, 16}, 1.0);
  ASSERT_OK_AND_ASSIGN(const auto preparation,
                       MeshPreparation::Create(bar, Eigen::VectorXd::Constant(bar.num_tets(), 1e4),
                                               testing::BarEnds(bar), {}));
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateArapDeformer(preparation, {}));
  for (const double angle : {std::numbers::pi, -std::numbers::pi, 2 * std::numbers::pi}) {
    HandlePose pose;
    pose.pivot_mm = {2, 2, 16};
    pose.rotation_vector = {0, 0, angle};
    ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(std::vector<HandlePose>{pose}));
    EXPECT_TRUE(result.summary.converged);
    const DeformationQuality quality = MeasureDeformation(bar, result.positions);
    EXPECT_EQ(quality.inverted_tets, 0);
    EXPECT_GT(quality.min_volume_ratio, 0.4);
    const int32_t outer = 4 + 5 * (4 + 5 * 8);  // corner (4, 4) of the middle layer
    const Eigen::Vector3d arm =
        result.positions.row(outer).transpose() - Eigen::Vector3d(2, 2, result.positions(outer, 2));
    const Eigen::Vector3d expected = RotationMatrix({0, 0, angle / 2}) * Eigen::Vector3d(2, 2, 0);
    // The bar also thins.
    EXPECT_GT(arm.normalized().dot(expected.normalized()), 0.99) << angle;
  }
}

TEST(ArapDeformerTest, EndsBelowTheEnergyOfTheGradientField) {
  RandomNumbers random(3);
  const auto preparation = testing::PrepareMesh(JitteredBar(), 1);
  ASSERT_OK_AND_ASSIGN(const auto arap, CreateArapDeformer(preparation, {}));
  ASSERT_OK_AND_ASSIGN(const auto field, CreateGradientFieldDeformer(preparation, {}));
  const auto poses = RandomPoses(1, 0.8, 0, 15, &random);
  ASSERT_OK_AND_ASSIGN(const Deformation result, arap->Deform(poses));
  ASSERT_OK_AND_ASSIGN(const Deformation start, field->Deform(poses));
  EXPECT_TRUE(result.summary.converged);
  EXPECT_LE(result.summary.changes_mm.back(), 0.001);
  EXPECT_NEAR(result.summary.energies_nj.front(), EnergyOf(*preparation, start.positions),
              1e-9 * result.summary.energies_nj.front());
  EXPECT_LT(result.summary.energies_nj.back(), 0.99 * result.summary.energies_nj.front());
}

// The soft half takes up most of the stretch.
TEST(ArapDeformerTest, SoftTissueGivesWay) {
  const TetMesh bar = testing::Bar({3, 3, 12}, 1.0);
  Eigen::VectorXd stiffness(bar.num_tets());
  for (Eigen::Index t = 0; t < bar.num_tets(); ++t) {
    stiffness[t] = bar.positions()(bar.tets()(t, 0), 2) < 6 ? 1e3 : 1e5;
  }
  ASSERT_OK_AND_ASSIGN(const auto preparation,
                       MeshPreparation::Create(bar, stiffness, testing::BarEnds(bar), {}));
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateArapDeformer(preparation, {}));
  HandlePose pose;
  pose.translation_mm = {0, 0, 3};
  ASSERT_OK_AND_ASSIGN(const Deformation result, deformer->Deform(std::vector<HandlePose>{pose}));
  const Eigen::Index middle = 1 + 4 * (1 + 4 * 6);
  EXPECT_GT(result.positions(middle, 2) - bar.positions()(middle, 2), 2.7);
}

TEST(ArapDeformerTest, OptionsOutOfRangeAreRefused) {
  const auto preparation = testing::PrepareMesh(JitteredBar(), 1);
  using ::tissueform::testing::kInvalid;
  EXPECT_THAT(CreateArapDeformer(preparation, {0, 0.001, 5}),
              StatusIs(kInvalid, HasSubstr("max_iterations")));
  EXPECT_THAT(CreateArapDeformer(preparation, {10, 0.001, -1}),
              StatusIs(kInvalid, HasSubstr("acceleration_depth")));
}

}  // namespace
}  // namespace tissueform
