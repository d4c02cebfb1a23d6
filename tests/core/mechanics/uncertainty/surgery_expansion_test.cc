// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/surgery_expansion.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/uncertainty/uncertainty_band.h"
#include "core/planning/plan_io.h"
#include "core/planning/skin_places.h"
#include "tests/core/mechanics/uncertainty/uncertain_bar.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using testing::Flat;
using testing::PartedBlock;
using testing::UncertainBar;

constexpr double kRadians = std::numbers::pi / 180;

// `pose`, and then a turn about `place` and a shift.
HandlePose Missed(HandlePose pose, const Eigen::Vector3d& place, const Eigen::Vector3d& turn,
                  const Eigen::Vector3d& shift) {
  const Eigen::Matrix3d by =
      turn.isZero(0) ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                     : Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  const Eigen::Vector3d pivot = pose.pivot_mm;
  const Eigen::Vector3d moved = by * (ApplyPose(pose, pivot) - place) + place + shift;
  const Eigen::AngleAxisd both(by * RotationMatrix(pose.rotation_vector));
  pose.rotation_vector = both.angle() * both.axis();
  pose.translation_mm = moved - pivot;
  return pose;
}

// The answer in full where all segments miss `poses` by this turn about `place`, and this shift.
Positions SolveMissed(UncertainBar bar, const Eigen::Vector3d& place, const Eigen::Vector3d& turn,
                      const Eigen::Vector3d& shift, const Eigen::VectorXd& z) {
  for (HandlePose& pose : bar.poses) pose = Missed(pose, place, turn, shift);
  return bar.Solve(z);
}

// Where the foremost tenth of the first handle is planned to be.
Eigen::Vector3d PlannedFront(const TetMesh& mesh, const ConstraintSet& constraints,
                             const HandlePose& pose) {
  std::vector<std::pair<double, int32_t>> by_front;
  for (const int32_t v : constraints.handles()[0].vertices) {
    by_front.emplace_back(mesh.positions()(v, 1), v);
  }
  std::ranges::sort(by_front);
  by_front.resize(by_front.size() / 10);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& [y, v] : by_front) sum += mesh.positions().row(v).transpose();
  return ApplyPose(pose, sum / static_cast<double>(by_front.size()));
}

Eigen::Vector3d PlannedFront(const UncertainBar& bar) {
  return PlannedFront(bar.mesh, bar.constraints, bar.poses[0]);
}

class SurgeryExpansionTest : public ::testing::Test {
 protected:
  absl::StatusOr<AnswerExpansion> Expand(const SurgeryDeviation& deviation) const {
    return ExpandSurgery(bar_.Prepare().get(), bar_.poses, bar_.Solve(),
                         Eigen::Matrix3d::Identity(), deviation);
  }
  const UncertainBar bar_{DeformationModel::kLinearElastic};
};

TEST_F(SurgeryExpansionTest, ShiftsEqualDifferencesOfFullAnswers) {
  const SurgeryDeviation deviation;
  ASSERT_OK_AND_ASSIGN(const AnswerExpansion expansion, Expand(deviation));
  ASSERT_EQ(expansion.variables, 6);
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d shift = deviation.translation_mm[axis] * Eigen::Vector3d::Unit(axis);
    const Positions missed = SolveMissed(bar_, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                                         shift, Eigen::VectorXd::Zero(3));
    const Eigen::VectorXd difference = Flat(missed - bar_.Solve());
    const Eigen::VectorXd field = expansion.terms[static_cast<size_t>(axis)].field;
    EXPECT_LT((field - difference).norm(), 1e-9 * difference.norm()) << axis;
  }
}

TEST_F(SurgeryExpansionTest, TurnsAreAboutOnePlaceAndEqualDifferencesOfFullAnswers) {
  ASSERT_OK_AND_ASSIGN(const AnswerExpansion expansion, Expand({}));
  constexpr double kStep = 0.05;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::VectorXd field = expansion.terms[static_cast<size_t>(3 + axis)].field;
    const Eigen::Vector3d turn =
        SurgeryDeviation().rotation_deg[axis] * kRadians * Eigen::Vector3d::Unit(axis);
    // On bone the field is that of a turn: its axis goes through one place.
    const Positions answer = bar_.Solve();
    const auto& vertices = bar_.constraints.handles()[0].vertices;
    const Eigen::Vector3d one = answer.row(vertices.front());
    for (const int32_t v : vertices) {
      const Eigen::Vector3d from_one = answer.row(v).transpose() - one;
      const Eigen::Vector3d expected =
          field.segment<3>(3 * vertices.front()) + turn.cross(from_one);
      ASSERT_LT((field.segment<3>(3 * v) - expected).norm(), 1e-7);
    }
    const Eigen::Vector3d place =
        one -
        turn.cross(-Eigen::Vector3d(field.segment<3>(3 * vertices.front()))) / turn.squaredNorm();
    const auto at = [&](double step) {
      return SolveMissed(bar_, place, step * turn, Eigen::Vector3d::Zero(),
                         Eigen::VectorXd::Zero(3));
    };
    const Eigen::VectorXd difference = Flat(at(kStep) - at(-kStep)) / (2 * kStep);
    EXPECT_LT((field - difference).norm(), 1e-4 * difference.norm()) << axis;
  }
}

TEST_F(SurgeryExpansionTest, ItTurnsAboutTheFrontOfTheSegment) {
  ASSERT_OK_AND_ASSIGN(const AnswerExpansion expansion, Expand({}));
  const Positions answer = bar_.Solve();
  const Eigen::Vector3d front = PlannedFront(bar_);
  // Of a turn about x the field along z grows with y, and is 0 where the front is.
  const Eigen::VectorXd& field = expansion.terms[3].field.col(0);
  const double turn = SurgeryDeviation().rotation_deg[0] * kRadians;
  for (const int32_t v : bar_.constraints.handles()[0].vertices) {
    EXPECT_NEAR(field[3 * v + 2], turn * (answer(v, 1) - front.y()), 1e-7);
  }
}

TEST_F(SurgeryExpansionTest, ASegmentThatStaysInPlaceIsNotMissed) {
  const std::vector<HandlePose> rest(1);
  ASSERT_OK_AND_ASSIGN(const AnswerExpansion expansion,
                       ExpandSurgery(bar_.Prepare().get(), rest, bar_.mesh.positions(),
                                     Eigen::Matrix3d::Identity(), {}));
  EXPECT_EQ(expansion.variables, 0);
  EXPECT_TRUE(expansion.terms.empty());
}

TEST(SurgeryOfLipsTest, WithContactItEqualsDifferencesThatPressInTheSameRows) {
  const PartedBlock block;
  const ConstraintSet constraints = block.Constraints();
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(block.mesh.num_tets(), 10000);
  const auto preparation = *MeshPreparation::Create(block.mesh, stiffness, constraints, {});
  DeformerOptions options;
  options.model = DeformationModel::kLinearElastic;
  const auto deformer = *CreateDeformer(preparation, options);
  std::vector<HandlePose> poses(1);
  poses[0].translation_mm = {0.1, -0.05, -0.2};
  const Deformation answer = *deformer->Deform(poses);
  ASSERT_GT(*std::ranges::max_element(answer.contact.forces), 0);
  ASSERT_OK_AND_ASSIGN(
      const AnswerExpansion expansion,
      ExpandSurgery(preparation.get(), poses, answer.positions, Eigen::Matrix3d::Identity(), {}));
  constexpr double kStep = 1e-3;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = [&](double step) {
      std::vector<HandlePose> missed = poses;
      missed[0].translation_mm[axis] += step * SurgeryDeviation().translation_mm[axis];
      return deformer->Deform(missed)->positions;
    };
    const Eigen::VectorXd difference = Flat(at(kStep) - at(-kStep)) / (2 * kStep);
    const Eigen::VectorXd field = expansion.terms[static_cast<size_t>(axis)].field;
    EXPECT_LT((field - difference).norm(), 1e-6 * difference.norm()) << axis;
  }
}

// 600 simulated patients: surgery that misses its plan, stiffness that is another one, each answer
// in full. A vertex lies within its band in 95 of 100 of them.
TEST_F(SurgeryExpansionTest, TheBandCoversPatientsAsOftenAsItSays) {
  const SurgeryDeviation deviation;
  ASSERT_OK_AND_ASSIGN(AnswerExpansion all, Expand(deviation));
  ASSERT_OK_AND_ASSIGN(
      const AnswerExpansion material,
      ExpandLinearElastic(bar_.Prepare().get(), bar_.uncertainty,
                          Flat(bar_.Solve() - bar_.mesh.positions()), ExpansionOrder::kSecond));
  Append(material, &all);
  ASSERT_EQ(all.variables, 9);
  const Positions answer = bar_.Solve();
  const UncertaintyBand band = SampleBand(all, SurfaceNormals(bar_.mesh, answer), 1);
  std::mt19937 random(2026);
  std::normal_distribution<double> normal;
  const auto three = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  constexpr int kPatients = 600;
  int inside = 0;
  int all_vertices = 0;
  for (int patient = 0; patient < kPatients; ++patient) {
    const Eigen::Vector3d shift = deviation.translation_mm.cwiseProduct(three());
    const Eigen::Vector3d turn = kRadians * deviation.rotation_deg.cwiseProduct(three());
    const Positions real = SolveMissed(bar_, PlannedFront(bar_), turn, shift, three());
    for (Eigen::Index v = 0; v < real.rows(); ++v) {
      if (band.size_mm[v] == 0) continue;
      inside += (real.row(v) - answer.row(v)).norm() <= band.size_mm[v] ? 1 : 0;
      ++all_vertices;
    }
  }
  const double coverage = static_cast<double>(inside) / all_vertices;
  EXPECT_GT(coverage, 0.93);
  EXPECT_LT(coverage, 0.97);
}

// The same of surgery alone on a head whose lips press and part: rows open and close as the segment
// misses its plan, which the first order does not follow.
TEST(SurgeryOfLipsTest, TheBandCoversPatientsWhoseLipsTouch) {
  const PlanProblem plan =
      *ResolvePlan(*ReadPlan(testing::TestDataPath("plans/head_lips/plan.json")));
  const auto preparation =
      *MeshPreparation::Create(*plan.mesh, plan.stiffness, plan.constraints, {});
  DeformerOptions options;
  options.model = DeformationModel::kLinearElastic;
  const auto deformer = *CreateDeformer(preparation, options);
  const Positions answer = deformer->Deform(plan.poses)->positions;
  const SurgeryDeviation deviation;
  ASSERT_OK_AND_ASSIGN(
      const AnswerExpansion expansion,
      ExpandSurgery(preparation.get(), plan.poses, answer, Eigen::Matrix3d::Identity(), deviation));
  const UncertaintyBand band = SampleBand(expansion, SurfaceNormals(*plan.mesh, answer), 1);
  std::mt19937 random(2027);
  std::normal_distribution<double> normal;
  const auto three = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  Eigen::VectorXd inside = Eigen::VectorXd::Zero(answer.rows());
  constexpr int kPatients = 300;
  constexpr double kMovedMm = 0.3;
  const Eigen::Vector3d front = PlannedFront(*plan.mesh, plan.constraints, plan.poses[0]);
  for (int patient = 0; patient < kPatients; ++patient) {
    std::vector<HandlePose> poses = plan.poses;
    poses[0] = Missed(poses[0], front, kRadians * deviation.rotation_deg.cwiseProduct(three()),
                      deviation.translation_mm.cwiseProduct(three()));
    const Positions real = deformer->Deform(poses)->positions;
    for (Eigen::Index v = 0; v < real.rows(); ++v) {
      inside[v] += (real.row(v) - answer.row(v)).norm() <= band.size_mm[v] ? 1 : 0;
    }
  }
  ASSERT_OK_AND_ASSIGN(const std::vector<SkinPlace> places, SkinPlaces(plan.point_data));
  for (const SkinPlace& place : places) {
    double sum = 0;
    int count = 0;
    for (const int32_t v : place.vertices) {
      if (band.size_mm[v] < kMovedMm) continue;
      sum += inside[v] / kPatients;
      ++count;
    }
    if (count == 0) continue;
    EXPECT_GT(sum / count, 0.93) << place.name;
    EXPECT_LT(sum / count, 0.97) << place.name;
  }
}

}  // namespace
}  // namespace tissueform
