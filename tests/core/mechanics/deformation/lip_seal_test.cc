// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/lip_seal.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/LU>

#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/elasticity/elastic_stiffness.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/status_matchers.h"

// Two blocks, one over the other, that are joined behind and parted in front.
namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::tissueform::testing::PartedBlock;
using ::tissueform::testing::StatusIs;

constexpr double kModulus = 15000;
constexpr double kPoisson = 0.45;

HandlePose Move(const Eigen::Vector3d& translation) {
  HandlePose pose;
  pose.translation_mm = translation;
  return pose;
}

std::shared_ptr<MeshPreparation> Prepare(const PartedBlock& block) {
  PreparationOptions options;
  options.poisson_ratio = kPoisson;
  return *MeshPreparation::Create(block.mesh,
                                  Eigen::VectorXd::Constant(block.mesh.num_tets(), kModulus),
                                  block.Constraints(), options);
}

// The same equations with a row for each condition and a multiplier for each row, all in one dense
// matrix. Which unilateral rows press is asked of the answer and then proved by the signs.
class DenseReference {
 public:
  DenseReference(const PartedBlock& block, const MeshPreparation& preparation,
                 const HandlePose& pose)
      : stiffness_(ElasticStiffness(preparation.elements(), preparation.vertex_cells(),
                                    preparation.stiffness(), kPoisson, 1)) {
    const ConstraintSet& constraints = preparation.constraints();
    const Positions& rest = block.mesh.positions();
    for (size_t i = 0; i < constraints.constrained().size(); ++i) {
      const int32_t vertex = constraints.constrained()[i];
      const Eigen::Vector3d place = rest.row(vertex);
      const bool moves = constraints.region_of_constrained()[i] != ConstraintSet::kFixed;
      const Eigen::Vector3d by = moves ? Eigen::Vector3d(ApplyPose(pose, place) - place)
                                       : Eigen::Vector3d(Eigen::Vector3d::Zero());
      for (int axis = 0; axis < 3; ++axis) {
        Demand(vertex, Eigen::Vector3d::Unit(axis), by[axis]);
      }
    }
    for (const ContactRow& row : block.rows) {
      const Eigen::Vector3d place = rest.row(row.vertex);
      const bool on_handle = row.handle != ContactRow::kFixedBone;
      const Eigen::Vector3d by = on_handle ? Eigen::Vector3d(ApplyPose(pose, place) - place)
                                           : Eigen::Vector3d(Eigen::Vector3d::Zero());
      Condition condition{Eigen::VectorXd::Zero(stiffness_.rows()),
                          row.normal.dot(by) - row.gap_mm};
      condition.direction.segment<3>(3 * row.vertex) += row.normal;
      if (row.other != ContactRow::kBone) {
        condition.direction.segment<3>(3 * row.other) -= row.normal;
      }
      (row.bilateral ? demanded_ : unilateral_).push_back(condition);
    }
  }

  void Demand(int32_t vertex, const Eigen::Vector3d& direction, double value) {
    Condition condition{Eigen::VectorXd::Zero(stiffness_.rows()), value};
    condition.direction.segment<3>(3 * vertex) = direction;
    demanded_.push_back(condition);
  }

  // Displacements, 3 #V. Expects the forces of `contact`, and its conditions to hold.
  Eigen::VectorXd Solve(const ContactAnswer& contact) const {
    std::vector<Condition> all = demanded_;
    std::vector<size_t> pressing;
    for (size_t r = 0; r < unilateral_.size(); ++r) {
      if (contact.forces[r] <= 0) continue;
      all.push_back(unilateral_[r]);
      pressing.push_back(r);
    }
    const Eigen::Index n = stiffness_.rows();
    const Eigen::Index m = n + static_cast<Eigen::Index>(all.size());
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(m, m);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(m);
    matrix.topLeftCorner(n, n) = Eigen::MatrixXd(stiffness_) / kModulus;
    for (size_t i = 0; i < all.size(); ++i) {
      const Eigen::Index at = n + static_cast<Eigen::Index>(i);
      matrix.col(at).head(n) = -all[i].direction;
      matrix.row(at).head(n) = all[i].direction.transpose();
      right[at] = all[i].value;
    }
    const Eigen::VectorXd solution = matrix.fullPivLu().solve(right);
    for (size_t i = 0; i < pressing.size(); ++i) {
      const double force = kModulus * solution[m - static_cast<Eigen::Index>(pressing.size() - i)];
      EXPECT_GT(force, 0);
      EXPECT_NEAR(contact.forces[pressing[i]], force, 1e-8 * kModulus);
    }
    for (const Condition& row : unilateral_) {
      EXPECT_GT(row.direction.dot(solution.head(n)), row.value - 1e-9);
    }
    return solution.head(n);
  }

 private:
  struct Condition {
    Eigen::VectorXd direction;
    double value;
  };

  const SparseMatrix stiffness_;
  std::vector<Condition> demanded_;
  std::vector<Condition> unilateral_;
};

Eigen::VectorXd DisplacementsOf(const Deformation& answer, const PartedBlock& block) {
  const Positions moved = answer.positions - block.mesh.positions();
  return Eigen::Map<const Eigen::VectorXd>(moved.data(), moved.size());
}

TEST(LipSealTest, AnswersAreThoseOfADenseSolveAndTheSealIsExact) {
  const PartedBlock block;
  const auto preparation = Prepare(block);
  LipEdge edge = block.Edge();
  ASSERT_THAT(edge.pairs, SizeIs(3));
  edge.up = Eigen::Vector3d(0.1, -0.2, 1).normalized();
  ASSERT_OK_AND_ASSIGN(const auto free, CreateLinearElasticDeformer(preparation));
  ASSERT_OK_AND_ASSIGN(const auto sealed, CreateSealedLipsDeformer(preparation, edge));
  bool was_pressed = false;
  for (const Eigen::Vector3d& move :
       {Eigen::Vector3d(0.05, -0.1, 0.5), Eigen::Vector3d(0.05, -0.4, -0.2),
        Eigen::Vector3d(-0.3, 0.5, 0.1), Eigen::Vector3d(0, 0.6, 0.3)}) {
    const HandlePose pose = Move(move);
    ASSERT_OK_AND_ASSIGN(const Deformation parted, free->Deform({pose}));
    ASSERT_OK_AND_ASSIGN(const Deformation answer, sealed->Deform({pose}));
    ASSERT_TRUE(answer.summary.converged);
    DenseReference reference(block, *preparation, pose);
    const Eigen::VectorXd expected_free = reference.Solve(parted.contact);
    EXPECT_LT((DisplacementsOf(parted, block) - expected_free).cwiseAbs().maxCoeff(), 1e-9);

    const Eigen::VectorXd found = DisplacementsOf(answer, block);
    double parted_mm = 0;
    for (const LipEdge::Pair& pair : edge.pairs) {
      const double height = edge.up.dot(expected_free.segment<3>(3 * pair.upper));
      EXPECT_NEAR(edge.up.dot(found.segment<3>(3 * pair.lower)), height, 1e-9);
      reference.Demand(pair.lower, edge.up, height);
      parted_mm = std::max(
          parted_mm, std::abs(height - edge.up.dot(expected_free.segment<3>(3 * pair.lower))));
    }
    EXPECT_LT((found - reference.Solve(answer.contact)).cwiseAbs().maxCoeff(), 1e-9);
    ASSERT_TRUE(answer.seal.has_value());
    EXPECT_EQ(answer.seal->pairs, 3);
    EXPECT_FALSE(answer.seal->released);
    EXPECT_NEAR(answer.seal->parted_mm, parted_mm, 1e-9);
    EXPECT_GT(parted_mm, 1e-3) << "the pose leaves the lips closed";
    EXPECT_FALSE(parted.seal.has_value());
    was_pressed |= std::ranges::any_of(answer.contact.forces, [](double f) { return f > 0; });
  }
  EXPECT_TRUE(was_pressed) << "no row presses in any pose";
}

// Forces of the whole body on the upper edge, K u, are those of the contact rows there.
TEST(LipSealTest, NoForceButContactActsOnTheUpperEdge) {
  const PartedBlock block;
  const auto preparation = Prepare(block);
  const LipEdge edge = block.Edge();
  ASSERT_OK_AND_ASSIGN(const auto sealed, CreateSealedLipsDeformer(preparation, edge));
  const SparseMatrix K = ElasticStiffness(preparation->elements(), preparation->vertex_cells(),
                                          preparation->stiffness(), kPoisson, 1);
  double held = 0;
  for (const double up : {0.5, -0.3}) {
    ASSERT_OK_AND_ASSIGN(const Deformation answer, sealed->Deform({Move({0.05, -0.1, up})}));
    Eigen::VectorXd forces = K * DisplacementsOf(answer, block);
    size_t unilateral = 0;
    for (const ContactRow& row : block.rows) {
      if (row.bilateral) continue;
      const double force = answer.contact.forces[unilateral++];
      forces.segment<3>(3 * row.vertex) -= force * row.normal;
      if (row.other != ContactRow::kBone) forces.segment<3>(3 * row.other) += force * row.normal;
    }
    for (const LipEdge::Pair& pair : edge.pairs) {
      EXPECT_LT(forces.segment<3>(3 * pair.upper).norm(), 1e-8 * kModulus);
      const Eigen::Vector3d on_lower = forces.segment<3>(3 * pair.lower);
      EXPECT_LT(on_lower.head<2>().norm(), 1e-8 * kModulus) << "across up";
      held = std::max(held, std::abs(on_lower.z()));
    }
  }
  EXPECT_GT(held, 0.01 * kModulus);
}

TEST(LipSealTest, RestStaysAtRest) {
  const PartedBlock block;
  ASSERT_OK_AND_ASSIGN(const auto sealed, CreateSealedLipsDeformer(Prepare(block), block.Edge()));
  ASSERT_OK_AND_ASSIGN(const Deformation answer, sealed->Deform({HandlePose()}));
  EXPECT_LT((answer.positions - block.mesh.positions()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(answer.seal, (SealAnswer{.pairs = 3, .parted_mm = 0, .released = false}));
}

TEST(LipSealTest, AnOpenedMouthReleasesTheLips) {
  const PartedBlock block;
  const auto preparation = Prepare(block);
  ASSERT_OK_AND_ASSIGN(const auto free, CreateLinearElasticDeformer(preparation));
  ASSERT_OK_AND_ASSIGN(const auto sealed, CreateSealedLipsDeformer(preparation, block.Edge()));
  ASSERT_OK_AND_ASSIGN(const Deformation one, sealed->Deform({Move({0, 0, 1})}));
  ASSERT_GT(one.seal->parted_mm, 0.1);
  // Nothing touches while the blocks are drawn apart, so the answer is linear.
  for (const double share : {0.99, 1.01}) {
    const HandlePose pose = Move({0, 0, share * kSealReleaseMm / one.seal->parted_mm});
    ASSERT_OK_AND_ASSIGN(const Deformation parted, free->Deform({pose}));
    ASSERT_OK_AND_ASSIGN(const Deformation answer, sealed->Deform({pose}));
    EXPECT_NEAR(answer.seal->parted_mm, share * kSealReleaseMm, 0.01);
    EXPECT_EQ(answer.seal->released, share > 1);
    EXPECT_EQ(answer.positions == parted.positions, share > 1);
  }
}

TEST(LipSealTest, RefusesPairsThatCannotMove) {
  PartedBlock block;
  const LipEdge edge = block.Edge();
  block.rows.push_back(
      {.vertex = edge.pairs[1].lower, .normal = Eigen::Vector3d::UnitZ(), .bilateral = true});
  EXPECT_THAT(CreateSealedLipsDeformer(Prepare(block), edge).status(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("contact seal: pair 1 cannot move: its lower vertex slides")));
  block.rows.back().bilateral = false;
  EXPECT_THAT(CreateSealedLipsDeformer(Prepare(block), edge).status(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("cannot move once the lips are sealed")));
}

}  // namespace
}  // namespace tissueform
