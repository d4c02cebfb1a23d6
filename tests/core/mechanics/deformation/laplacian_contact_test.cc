// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/laplacian_contact.h"

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Dense>

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mesh/operators/laplacian.h"
#include "tests/core/mechanics/deformation/sliding_block.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::GapsOf;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::Pose;
using ::tissueform::testing::RandomPose;
using ::tissueform::testing::SlidingBlock;
using ::tissueform::testing::StatusIs;

// The answer by one dense system of all coordinates and all closed rows: the rows that may lift off
// are taken from the answer under test, whose gaps and forces then have to have the right signs.
class DenseReference {
 public:
  explicit DenseReference(const MeshPreparation& preparation)
      : rows_(preparation.constraints().contact()), constraints_(preparation.constraints()) {
    L_ = CotangentLaplacian(preparation.mesh(), preparation.stiffness(), 1);
  }

  // Minimises tr(d^T L d) / 2 - tr(b^T d). `targets` are displacements of the constrained vertices.
  struct Answer {
    Positions displacements;
    Eigen::VectorXd multipliers;  // of `closed`
  };
  Answer Solve(const Eigen::MatrixXd& b, const Positions& targets,
               const std::vector<size_t>& closed, const Eigen::VectorXd& resting_gaps) const {
    const Eigen::Index n = L_.rows();
    const auto held = static_cast<Eigen::Index>(constraints_.constrained().size());
    const auto num_closed = static_cast<Eigen::Index>(closed.size());
    const Eigen::Index size = 3 * n + 3 * held + num_closed;
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd rhs = Eigen::VectorXd::Zero(size);
    for (int axis = 0; axis < 3; ++axis) {
      A.block(axis * n, axis * n, n, n) = L_;
      rhs.segment(axis * n, n) = b.col(axis);
      for (Eigen::Index c = 0; c < held; ++c) {
        const Eigen::Index at = axis * n + constraints_.constrained()[static_cast<size_t>(c)];
        const Eigen::Index of = 3 * n + axis * held + c;
        A(at, of) = A(of, at) = 1;
        rhs[of] = targets(c, axis);
      }
      for (Eigen::Index i = 0; i < num_closed; ++i) {
        const ContactRow& row = rows_[closed[static_cast<size_t>(i)]];
        const Eigen::Index of = 3 * (n + held) + i;
        A(axis * n + row.vertex, of) = A(of, axis * n + row.vertex) = row.normal[axis];
        if (row.other == ContactRow::kBone) continue;
        A(axis * n + row.other, of) = A(of, axis * n + row.other) = -row.normal[axis];
      }
    }
    for (Eigen::Index i = 0; i < num_closed; ++i) {
      rhs[3 * (n + held) + i] = -resting_gaps[static_cast<Eigen::Index>(closed[i])];
    }
    const Eigen::VectorXd x = A.fullPivLu().solve(rhs);
    Answer answer{Positions(n, 3), -x.tail(num_closed)};
    for (int axis = 0; axis < 3; ++axis) answer.displacements.col(axis) = x.segment(axis * n, n);
    return answer;
  }

 private:
  Eigen::MatrixXd L_;
  const std::vector<ContactRow>& rows_;
  const ConstraintSet& constraints_;
};

TEST(LaplacianContactTest, PlainPoissonIsTheDenseSystemsOfAllCoordinatesAndRows) {
  const auto preparation = SlidingBlock().Prepare();
  const std::vector<ContactRow>& rows = preparation->constraints().contact();
  DeformerOptions options;
  options.gradient_field.rotation = RotationMode::kNone;
  options.gradient_field.compute_residual = true;
  const auto deformer = *CreateDeformer(preparation, options);
  const DenseReference reference(*preparation);
  const Positions& rest = preparation->mesh().positions();
  std::mt19937 generator(2);
  size_t closed_in_all = 0;
  for (int i = 0; i < 3; ++i) {
    const HandlePose pose = RandomPose(&generator);
    const Deformation answer = *deformer->Deform({pose});
    EXPECT_TRUE(answer.summary.converged);
    EXPECT_LT(answer.summary.residual, 1e-12);
    std::vector<size_t> closed;
    size_t unilateral = 0;
    for (size_t r = 0; r < rows.size(); ++r) {
      const bool touches = rows[r].bilateral || answer.contact.forces[unilateral] > 0;
      if (touches) closed.push_back(r);
      if (!rows[r].bilateral) ++unilateral;
    }
    ASSERT_EQ(unilateral, answer.contact.forces.size());
    closed_in_all += closed.size();
    const auto& held = preparation->constraints().constrained();
    const DenseReference::Answer expected = reference.Solve(
        Eigen::MatrixXd::Zero(rest.rows(), 3), (answer.positions - rest)(held, Eigen::all), closed,
        GapsOf(*preparation, Positions::Zero(rest.rows(), 3), pose));
    EXPECT_LT((answer.positions - rest - expected.displacements).cwiseAbs().maxCoeff(), 1e-10);
    // The conditions of contact in the reference.
    const Eigen::VectorXd gaps = GapsOf(*preparation, expected.displacements, pose);
    EXPECT_GT(gaps.minCoeff(), -1e-10);
    for (size_t c = 0; c < closed.size(); ++c) {
      if (rows[closed[c]].bilateral) continue;
      EXPECT_GT(expected.multipliers[static_cast<Eigen::Index>(c)], 0);
    }
    EXPECT_LT(answer.contact.residual_mm, 1e-12);
  }
  EXPECT_GT(closed_in_all, 3 * 8 + 2U) << "more than the bilateral rows touch";
  EXPECT_LT(closed_in_all, 3 * rows.size()) << "some rows are open";
}

struct Setting {
  const char* name;
  DeformerOptions options;
};

void PrintTo(const Setting& setting, std::ostream* out) { *out << setting.name; }

DeformerOptions GradientField(RotationMode rotation, Guidance guidance = Guidance::kCotangent) {
  DeformerOptions options;
  options.gradient_field.rotation = rotation;
  options.gradient_field.guidance = guidance;
  options.gradient_field.tolerance_mm = 1e-8;
  options.gradient_field.max_iterations = 300;
  return options;
}

DeformerOptions Arap() {
  DeformerOptions options;
  options.model = DeformationModel::kArap;
  options.arap.tolerance_mm = 1e-6;
  options.arap.max_iterations = 1000;
  return options;
}

class ModelOnLaplacianTest : public ::testing::TestWithParam<Setting> {};

INSTANTIATE_TEST_SUITE_P(
    Models, ModelOnLaplacianTest,
    ::testing::Values(Setting{"Propagated", GradientField(RotationMode::kPropagated)},
                      Setting{"Uniform",
                              GradientField(RotationMode::kPropagated, Guidance::kUniform)},
                      Setting{"Estimated", GradientField(RotationMode::kEstimated)},
                      Setting{"None", GradientField(RotationMode::kNone)}, Setting{"Arap", Arap()}),
    [](const auto& setting) { return setting.param.name; });

TEST_P(ModelOnLaplacianTest, RowsHoldInEveryPose) {
  testing::ExpectRowsHoldInEveryPose(
      GetParam().options,
      {.bilateral = 1e-11, .penetration = 1e-11, .reported_gap = 1e-11, .residual = 1e-9});
}

TEST_P(ModelOnLaplacianTest, AnswersDoNotDependOnTheDragBefore) {
  const auto preparation = SlidingBlock().Prepare();
  const auto deformer = *CreateDeformer(preparation, GetParam().options);
  const auto fresh = *CreateDeformer(preparation, GetParam().options);
  std::mt19937 generator(9);
  HandlePose pose;
  for (int i = 0; i < 10; ++i) {
    pose = RandomPose(&generator);
    ASSERT_THAT(deformer->Deform({pose}), IsOk());
  }
  const Deformation again = *deformer->Deform({pose});
  const Deformation cold = *fresh->Deform({pose});
  EXPECT_EQ(again.positions, cold.positions);
  EXPECT_EQ(again.contact.forces, cold.contact.forces);
}

// Rows in three directions are what a region is.
TEST_P(ModelOnLaplacianTest, SlidingInNoDirectionIsSticking) {
  const SlidingBlock block(/*only_bilateral=*/true);
  const auto sliding = block.WithRowsInAllDirections().Prepare();
  const auto sticking = block.Sticking().Prepare();
  const HandlePose pose = Pose({0.2, -0.1, 0.3}, {0.3, -0.2, 0.2});
  const Deformation found = *(*CreateDeformer(sliding, GetParam().options))->Deform({pose});
  const Deformation expected = *(*CreateDeformer(sticking, GetParam().options))->Deform({pose});
  EXPECT_LT((found.positions - expected.positions).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_GT((expected.positions - block.mesh_.positions()).cwiseAbs().maxCoeff(), 0.1);
}

TEST_P(ModelOnLaplacianTest, AMovementOfEverythingIsThatMovement) {
  SlidingBlock block;
  block.held_.insert(block.held_.end(), block.fixed_.begin(), block.fixed_.end());
  block.fixed_ = {};
  for (ContactRow& row : block.rows_) row.gap_mm = 0;
  const Deformation answer = *(*CreateDeformer(block.Prepare(), GetParam().options))
                                  ->Deform({Pose({0, 0, 0}, {3, -2, 5})});
  const Positions moved = answer.positions - block.mesh_.positions();
  EXPECT_LT((moved.rowwise() - Eigen::RowVector3d(3, -2, 5)).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(LaplacianContactTest, ArapsEnergyNeverRises) {
  const auto preparation = SlidingBlock().Prepare();
  const auto deformer = *CreateDeformer(preparation, Arap());
  std::mt19937 generator(12);
  for (int i = 0; i < 20; ++i) {
    const Deformation answer = *deformer->Deform({RandomPose(&generator)});
    const std::vector<double>& energies = answer.summary.energies_nj;
    for (size_t e = 1; e < energies.size(); ++e) EXPECT_LE(energies[e], energies[e - 1]);
    EXPECT_TRUE(answer.summary.converged);
  }
}

TEST(LaplacianContactTest, ARowThatCannotMoveIsRefused) {
  SlidingBlock block(/*only_bilateral=*/true);
  ContactRow row = block.rows_[0];
  row.bilateral = false;
  row.handle = ContactRow::kFixedBone;
  block.rows_.push_back(row);
  EXPECT_THAT(block.Prepare()->Laplacian(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("cannot move")));
}

}  // namespace
}  // namespace tissueform
