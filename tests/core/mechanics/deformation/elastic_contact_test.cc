// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/elastic_contact.h"

#include <cmath>
#include <memory>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "core/mechanics/contact/lcp_solver.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "tests/testing/elastic_bar.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::Each;
using ::testing::Ge;
using ::testing::Gt;
using ::testing::HasSubstr;
using ::tissueform::testing::Bar;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::Pose;
using ::tissueform::testing::SelectVertices;
using ::tissueform::testing::StatusIs;

constexpr double kModulus = 15000;  // Pa
constexpr double kPoisson = 0.45;
constexpr double kSide = 3;    // mm
constexpr double kHeight = 4;  // mm
constexpr int kTop = 0;        // the first handle

// A block that is turned in space, so that no normal is along an axis. In its own coordinates it
// fills [0, 3] x [0, 3] x [0, 4] mm; its walls x = 0 and y = 0 slide, and so the answer to a
// movement along z is uniform.
class BlockTest : public ::testing::Test {
 protected:
  BlockTest() {
    const TetMesh even = Bar({3, 3, 4});
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> noise(-0.15, 0.15);
    own_ = even.positions();
    for (Eigen::Index v = 0; v < own_.rows(); ++v) {
      const Eigen::RowVector3d x = own_.row(v);
      const bool inside = x.minCoeff() > 0.5 && x.head<2>().maxCoeff() < 2.5 && x.z() < 3.5;
      if (inside) own_.row(v) += Eigen::RowVector3d(noise(generator), noise(generator), 0.1);
    }
    tets_ = even.tets();
  }

  static Eigen::Matrix3d Turn() {
    return Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -0.5).normalized()).toRotationMatrix();
  }
  TetMesh Mesh() const { return *TetMesh::Create(own_ * Turn().transpose(), tets_); }

  template <typename Inside>
  std::vector<int32_t> Where(Inside inside) const {
    std::vector<int32_t> found;
    for (int32_t v = 0; v < own_.rows(); ++v) {
      if (inside(Eigen::Vector3d(own_.row(v)))) found.push_back(v);
    }
    return found;
  }
  // A row at every vertex of the wall that is not constrained.
  template <typename Inside>
  void AddWall(Inside inside, const Eigen::Vector3d& own_normal, const ContactRow& like) {
    for (const int32_t v : Where(inside)) {
      if (std::ranges::find(constrained_, v) != constrained_.end()) continue;
      ContactRow row = like;
      row.vertex = v;
      row.normal = Turn() * own_normal;
      rows_.push_back(row);
    }
  }
  void AddSlidingSides() {
    AddWall([](const auto& x) { return x.x() == 0; }, {1, 0, 0}, {.bilateral = true});
    AddWall([](const auto& x) { return x.y() == 0; }, {0, 1, 0}, {.bilateral = true});
  }

  std::shared_ptr<MeshPreparation> Prepare(std::vector<int32_t> fixed,
                                           std::vector<HandleRegion> handles) const {
    auto constraints =
        ConstraintSet::Create(own_.rows(), std::move(fixed), std::move(handles), rows_);
    EXPECT_THAT(constraints, IsOk());
    PreparationOptions options;
    options.poisson_ratio = kPoisson;
    return *MeshPreparation::Create(Mesh(), Eigen::VectorXd::Constant(tets_.rows(), kModulus),
                                    *constraints, options);
  }
  // Along the block's own axis.
  static HandlePose Move(const Eigen::Vector3d& own_translation) {
    HandlePose pose;
    pose.translation_mm = Turn() * own_translation;
    return pose;
  }
  // In the block's own coordinates.
  Positions OwnDisplacements(const Deformation& answer) const {
    return answer.positions * Turn() - own_;
  }
  // Of a block that is shortened by `down` mm and free to widen.
  void ExpectUniform(const Deformation& answer, double down) const {
    Positions expected(own_.rows(), 3);
    expected.col(0) = own_.col(0) * kPoisson * down / kHeight;
    expected.col(1) = own_.col(1) * kPoisson * down / kHeight;
    expected.col(2) = -own_.col(2) * down / kHeight;
    EXPECT_LT((OwnDisplacements(answer) - expected).cwiseAbs().maxCoeff(), 1e-10);
  }

  Positions own_;
  TetIndices tets_;
  std::vector<int32_t> constrained_;
  std::vector<ContactRow> rows_;
};

TEST_F(BlockTest, SlidingWallsGiveTheUniformAnswer) {
  constrained_ = Where(
      [](const auto& x) { return x.head(2).norm() == 0 && (x.z() == 0 || x.z() == kHeight); });
  ASSERT_EQ(constrained_.size(), 2U);
  AddSlidingSides();
  AddWall([](const auto& x) { return x.z() == 0; }, {0, 0, 1}, {.bilateral = true});
  AddWall([](const auto& x) { return x.z() == kHeight; }, {0, 0, -1},
          {.handle = kTop, .bilateral = true});
  const auto preparation = Prepare({constrained_[0]}, {{"top", {constrained_[1]}}});
  const auto deformer = CreateLinearElasticDeformer(preparation);
  ASSERT_THAT(deformer, IsOk());
  for (const double down : {1.0, -0.5}) {
    ExpectUniform(*(*deformer)->Deform({Move({0, 0, -down})}), down);
  }
}

// Of a block on a plate that moves up and down under it. The plate is a handle; its one vertex
// belongs to a tet of its own.
class BlockOnPlateTest : public BlockTest {
 protected:
  BlockOnPlateTest() {
    const auto vertices = static_cast<int32_t>(own_.rows());
    const Eigen::Index tets = tets_.rows();
    own_.conservativeResize(vertices + 4, 3);
    own_.bottomRows(4) << 5, 5, -9, 6, 5, -9, 5, 6, -9, 5, 5, -8;
    tets_.conservativeResize(tets + 1, 4);
    tets_.row(tets) << vertices, vertices + 1, vertices + 2, vertices + 3;
    plate_ = {{"plate", {vertices, vertices + 1, vertices + 2, vertices + 3}}};
    constrained_ = Where([](const auto& x) { return x.head(2).norm() == 0 && x.z() == kHeight; });
    AddSlidingSides();
    AddWall([](const auto& x) { return x.z() == kHeight; }, {0, 0, -1}, {.bilateral = true});
  }
  void AddPlate(double gap_mm) {
    AddWall([](const auto& x) { return x.z() == 0; }, {0, 0, 1},
            {.handle = kTop, .gap_mm = gap_mm});
  }
  // Shortened from below, the top at rest.
  void ExpectShortened(const Deformation& answer, double up) const {
    Positions expected(own_.rows(), 3);
    expected.col(0) = own_.col(0) * kPoisson * up / kHeight;
    expected.col(1) = own_.col(1) * kPoisson * up / kHeight;
    expected.col(2) = ((kHeight - own_.col(2).array()) * up / kHeight).matrix();
    const Positions found = OwnDisplacements(answer);
    const Eigen::Index block = own_.rows() - 4;
    EXPECT_LT((found - expected).topRows(block).cwiseAbs().maxCoeff(), 1e-10);
  }

  std::vector<HandleRegion> plate_;
};

TEST_F(BlockOnPlateTest, IsPushedUpByTheRightForceAndLeftAloneBelow) {
  AddPlate(/*gap_mm=*/0);
  const auto deformer = CreateLinearElasticDeformer(Prepare(constrained_, plate_));
  ASSERT_THAT(deformer, IsOk());
  const Deformation up = *(*deformer)->Deform({Move({0, 0, 0.4})});
  ExpectShortened(up, 0.4);
  EXPECT_THAT(up.contact.forces, Each(Gt(0)));
  const double force = std::accumulate(up.contact.forces.begin(), up.contact.forces.end(), 0.0);
  EXPECT_NEAR(force, kModulus * kSide * kSide * 0.4 / kHeight, 1e-6);
  EXPECT_LT(up.contact.residual_mm, 1e-12);
  const Deformation down = *(*deformer)->Deform({Move({0, 0, -0.4})});
  ExpectShortened(down, 0);
  for (size_t row = 0; row < down.contact.forces.size(); ++row) {
    EXPECT_EQ(down.contact.forces[row], 0);
    EXPECT_NEAR(down.contact.gaps_mm[row], 0.4, 1e-12);
  }
}

TEST_F(BlockOnPlateTest, ClosesTheInitialGapBeforeContact) {
  AddPlate(/*gap_mm=*/0.25);
  const auto deformer = CreateLinearElasticDeformer(Prepare(constrained_, plate_));
  ASSERT_THAT(deformer, IsOk());
  ExpectShortened(*(*deformer)->Deform({Move({0, 0, 0.2})}), 0);
  ExpectShortened(*(*deformer)->Deform({Move({0, 0, 0.4})}), 0.15);
}

// Two blocks, one on the other, with the vertices of their faces in pairs.
class TwoBlocksTest : public BlockTest {
 protected:
  TwoBlocksTest() {
    const auto vertices = static_cast<int32_t>(own_.rows());
    const Eigen::Index tets = tets_.rows();
    lower_vertices_ = vertices;
    const Positions lower = own_.rowwise() - Eigen::RowVector3d(0, 0, kHeight);
    own_.conservativeResize(2 * vertices, 3);
    own_.bottomRows(vertices) = lower;
    tets_.conservativeResize(2 * tets, 4);
    tets_.bottomRows(tets) = (tets_.topRows(tets).array() + vertices).matrix();
    constrained_ = Where([](const auto& x) {
      return x.head(2).norm() == 0 && (x.z() == kHeight || x.z() == -kHeight);
    });
    AddSlidingSides();
    AddWall([](const auto& x) { return x.z() == -kHeight; }, {0, 0, 1}, {.bilateral = true});
    AddWall([](const auto& x) { return x.z() == kHeight; }, {0, 0, -1},
            {.handle = kTop, .bilateral = true});
    for (int32_t v = 0; v < vertices; ++v) {
      if (own_(v, 2) != 0) continue;
      for (int32_t w = vertices; w < 2 * vertices; ++w) {
        if (own_.row(v) == own_.row(w)) {
          rows_.push_back({.vertex = v, .other = w, .normal = Turn() * Eigen::Vector3d::UnitZ()});
        }
      }
    }
    const int32_t top = own_(constrained_[0], 2) > 0 ? 0 : 1;
    preparation_ = Prepare({constrained_[1 - top]}, {{"top", {constrained_[top]}}});
    deformer_ = *CreateLinearElasticDeformer(preparation_);
  }

  // Mean displacement along the block's axis of the two faces, upper and lower.
  std::pair<double, double> Faces(const Deformation& answer) const {
    const Positions moved = OwnDisplacements(answer);
    std::pair<double, double> mean = {0, 0};
    for (int32_t v = 0; v < own_.rows(); ++v) {
      if (own_(v, 2) == 0) (v < lower_vertices_ ? mean.first : mean.second) += moved(v, 2) / 16;
    }
    return mean;
  }

  int32_t lower_vertices_ = 0;
  std::shared_ptr<MeshPreparation> preparation_;
  std::unique_ptr<Deformer> deformer_;
};

TEST_F(TwoBlocksTest, ArePressedTogetherAsOneAndPartFreely) {
  const Deformation pressed = *deformer_->Deform({Move({0, 0, -0.6})});
  const auto [upper, lower] = Faces(pressed);
  EXPECT_NEAR(upper, -0.3, 1e-10);
  EXPECT_NEAR(lower, -0.3, 1e-10);
  const double force =
      std::accumulate(pressed.contact.forces.begin(), pressed.contact.forces.end(), 0.0);
  EXPECT_NEAR(force, kModulus * kSide * kSide * 0.6 / (2 * kHeight), 1e-6);
  const Deformation parted = *deformer_->Deform({Move({0, 0, 0.6})});
  EXPECT_NEAR(Faces(parted).first, 0.6, 1e-10);
  EXPECT_NEAR(Faces(parted).second, 0, 1e-10);
}

TEST_F(TwoBlocksTest, AnswersDoNotDependOnTheDragBefore) {
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> number(-0.4, 0.4);
  std::vector<HandlePose> poses(30);
  for (HandlePose& pose : poses) {
    pose = Move({number(generator), number(generator), number(generator)});
    pose.rotation_vector = {number(generator), number(generator), number(generator)};
  }
  std::vector<Deformation> first;
  first.reserve(poses.size());
  for (const HandlePose& pose : poses) first.push_back(*deformer_->Deform({pose}));
  size_t some_open = 0;
  for (size_t i = poses.size(); i-- > 0;) {
    const Deformation again = *deformer_->Deform({poses[i]});
    EXPECT_EQ(again.positions, first[i].positions);
    EXPECT_EQ(again.contact.forces, first[i].contact.forces);
    EXPECT_TRUE(again.summary.converged);
    EXPECT_LT(again.contact.residual_mm, 1e-9);
    EXPECT_THAT(again.contact.gaps_mm, Each(Ge(-1e-9)));
    const auto open = std::ranges::count(again.contact.forces, 0.0);
    some_open += open > 0 && open < 16 ? 1 : 0;
  }
  EXPECT_GT(some_open, 5U) << "the poses do not open the contact in part";
}

TEST_F(TwoBlocksTest, AThousandPosesDoNotPenetrateFromAnyStartAndStoreTheLeastEnergy) {
  const ElasticContact& contact = **preparation_->Contact();
  const ElasticSystem& elastic = **preparation_->Elastic();
  const Eigen::MatrixXd& C = contact.compliance();
  const auto rows = static_cast<size_t>(C.rows());
  const std::span<const double> entries(C.data(), rows * rows);
  const Eigen::LLT<Eigen::MatrixXd> factor(C);
  LcpSolver warm(entries, rows);
  std::mt19937 generator(8);
  std::uniform_real_distribution<double> number(-0.5, 0.5);
  for (int i = 0; i < 1000; ++i) {
    HandlePose pose = Move({number(generator), number(generator), number(generator)});
    pose.rotation_vector = {number(generator), number(generator), number(generator)};
    const Eigen::VectorXd q = contact.Gaps(elastic.Coefficients({pose}));
    LcpSolver cold(entries, rows);
    const LcpSolution& solution = warm.Solve({q.data(), rows});
    ASSERT_TRUE(solution.converged);
    EXPECT_EQ(solution.sweeps, 0) << "the active set sufficed";
    EXPECT_EQ(cold.Solve({q.data(), rows}).multipliers, solution.multipliers);
    const Eigen::Map<const Eigen::VectorXd> forces(solution.multipliers.data(), C.rows());
    EXPECT_GE((q + C * forces).minCoeff(), -1e-9);
    // Of contact the body stores l C l / 2. Other ways to keep the blocks apart store no less.
    Eigen::VectorXd other_gaps(C.rows());
    for (double& gap : other_gaps) gap = std::max(0.0, number(generator));
    const Eigen::VectorXd others = factor.solve(other_gaps - q);
    EXPECT_LE(forces.dot(C * forces), others.dot(C * others) * (1 + 1e-12));
  }
}

// Against the definition: forces and gaps from a solve with the stiffness matrix.
TEST_F(TwoBlocksTest, GapsAreThoseOfTheDisplacements) {
  HandlePose pose = Move({0.1, 0.2, -0.3});
  pose.rotation_vector = {0.05, -0.1, 0.03};
  const Deformation answer = *deformer_->Deform({pose});
  const Positions moved = answer.positions - preparation_->mesh().positions();
  const std::vector<ContactRow>& rows = preparation_->constraints().contact();
  size_t unilateral = 0;
  for (const ContactRow& row : rows) {
    const Eigen::Vector3d of_vertex = moved.row(row.vertex);
    if (row.other != ContactRow::kBone) {
      const Eigen::Vector3d of_other = moved.row(row.other);
      EXPECT_NEAR(row.normal.dot(of_vertex - of_other), answer.contact.gaps_mm[unilateral++],
                  1e-10);
    } else {
      const Eigen::Vector3d place = preparation_->mesh().positions().row(row.vertex);
      const Eigen::Vector3d of_bone = row.handle == kTop
                                          ? Eigen::Vector3d(ApplyPose(pose, place) - place)
                                          : Eigen::Vector3d::Zero();
      EXPECT_NEAR(row.normal.dot(of_vertex - of_bone), 0, 1e-10) << "it slides";
    }
  }
  EXPECT_EQ(unilateral, answer.contact.gaps_mm.size());
}

TEST_F(TwoBlocksTest, ComplianceIsThatOfTheSolvesAndSymmetric) {
  const auto contact = preparation_->Contact();
  ASSERT_THAT(contact, IsOk());
  const ElasticSystem& elastic = **preparation_->Elastic();
  const std::vector<ContactRow>& rows = preparation_->constraints().contact();
  const Eigen::MatrixXd& C = (*contact)->compliance();
  EXPECT_EQ(C, C.transpose());
  const auto at = [&](const Eigen::MatrixXd& u, const ContactRow& row) {
    return row.normal.dot(u.col(0).segment<3>(3 * row.vertex) - u.col(0).segment<3>(3 * row.other));
  };
  const auto num_constrained = static_cast<Eigen::Index>(constrained_.size());
  for (Eigen::Index j = 0; j < C.cols(); j += 5) {
    const ContactRow& pushed = rows[static_cast<size_t>((*contact)->rows()[j])];
    Eigen::MatrixXd force = Eigen::MatrixXd::Zero(3 * own_.rows(), 1);
    force.col(0).segment<3>(3 * pushed.vertex) += pushed.normal;
    force.col(0).segment<3>(3 * pushed.other) -= pushed.normal;
    const Eigen::MatrixXd u = *elastic.Solve(force, Eigen::MatrixXd::Zero(3 * num_constrained, 1));
    for (Eigen::Index i = 0; i < C.rows(); ++i) {
      const ContactRow& row = rows[static_cast<size_t>((*contact)->rows()[i])];
      EXPECT_NEAR(C(i, j), at(u, row), 1e-12 * C.maxCoeff());
    }
  }
}

// Rows in three directions are what a region is.
TEST(ElasticContactTest, SlidingInNoDirectionIsSticking) {
  const TetMesh mesh = Bar({4, 3, 8}, 1.0, 0.15);
  const auto fixed = SelectVertices(mesh, [](const auto& v) { return v.z() < 0.5; });
  const auto low = SelectVertices(mesh, [](const auto& v) { return v.z() < 0.5 || v.x() < 0.5; });
  const auto top = SelectVertices(mesh, [](const auto& v) { return v.z() > 7.5 && v.x() > 0.5; });
  const auto front = SelectVertices(
      mesh, [](const auto& v) { return v.y() > 2.5 && v.z() > 4 && v.z() < 7.5 && v.x() > 0.5; });
  std::vector<int32_t> top_and_front = top;
  top_and_front.insert(top_and_front.end(), front.begin(), front.end());
  const Eigen::Matrix3d axes =
      Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, -1, 2).normalized()).toRotationMatrix();
  std::vector<ContactRow> rows;
  const auto add = [&](int32_t vertex, int handle) {
    for (int axis = 0; axis < 3; ++axis) {
      rows.push_back(
          {.vertex = vertex, .handle = handle, .normal = axes.col(axis), .bilateral = true});
    }
  };
  for (const int32_t v : front) add(v, 0);
  for (const int32_t v : low) {
    if (std::ranges::find(fixed, v) == fixed.end()) add(v, ContactRow::kFixedBone);
  }
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(mesh.num_tets(), kModulus);
  const auto sticking = MeshPreparation::Create(
      mesh, stiffness, *ConstraintSet::Create(mesh, low, {{"top", top_and_front}}), {});
  const auto sliding = MeshPreparation::Create(
      mesh, stiffness, *ConstraintSet::Create(mesh, fixed, {{"top", top}}, rows), {});
  const HandlePose pose = Pose({0.3, -0.2, 0.1}, {1, 0.5, -0.7}, 1.05);
  const Positions expected = (*CreateLinearElasticDeformer(*sticking))->Deform({pose})->positions;
  const Positions found = (*CreateLinearElasticDeformer(*sliding))->Deform({pose})->positions;
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(ElasticContactTest, AMovementOfEverythingIsThatMovementWithoutAnyForce) {
  const TetMesh mesh = Bar({3, 3, 4}, 1.0, 0.15);
  const auto bottom = SelectVertices(mesh, [](const auto& v) { return v.z() < 0.5; });
  std::vector<ContactRow> rows;
  for (const int32_t v : SelectVertices(mesh, [](const auto& v) { return v.z() > 3.5; })) {
    const bool bilateral = mesh.positions()(v, 0) < 1.5;
    rows.push_back({.vertex = v,
                    .handle = kTop,
                    .normal = Eigen::Vector3d(0.3, 0.1, -1).normalized(),
                    .bilateral = bilateral});
  }
  const auto preparation =
      MeshPreparation::Create(mesh, Eigen::VectorXd::Constant(mesh.num_tets(), kModulus),
                              *ConstraintSet::Create(mesh, {}, {{"bone", bottom}}, rows), {});
  const Deformation answer =
      *(*CreateLinearElasticDeformer(*preparation))->Deform({Pose({0, 0, 0}, {3, -2, 5})});
  const Positions moved = answer.positions - mesh.positions();
  EXPECT_LT((moved.rowwise() - Eigen::RowVector3d(3, -2, 5)).cwiseAbs().maxCoeff(), 1e-11);
  for (const double force : answer.contact.forces) EXPECT_LT(force, 1e-6);
}

absl::StatusOr<ConstraintSet> BetweenItsEnds(const TetMesh& bar, std::vector<ContactRow> rows) {
  const ConstraintSet ends = testing::BarEnds(bar);
  return ConstraintSet::Create(bar, ends.fixed(), ends.handles(), std::move(rows));
}

TEST(ElasticContactTest, EveryModelAcceptsContact) {
  const TetMesh mesh = Bar({3, 3, 4});
  const auto constraints = BetweenItsEnds(mesh, {{.vertex = 20}});
  ASSERT_THAT(constraints, IsOk());
  const auto preparation = MeshPreparation::Create(
      mesh, Eigen::VectorXd::Constant(mesh.num_tets(), kModulus), *constraints, {});
  for (const ModelTraits& model : AllModels()) {
    DeformerOptions options;
    options.model = model.model;
    EXPECT_THAT(CreateDeformer(*preparation, options).status(), IsOk()) << model.name;
  }
}

TEST(ElasticContactTest, ARowThatCannotMoveIsRefused) {
  const TetMesh mesh = Bar({3, 3, 4});
  const auto constraints = BetweenItsEnds(
      mesh, {{.vertex = 20, .bilateral = true}, {.vertex = 21}, {.vertex = 20, .handle = 0}});
  ASSERT_THAT(constraints, IsOk());
  const auto preparation = MeshPreparation::Create(
      mesh, Eigen::VectorXd::Constant(mesh.num_tets(), kModulus), *constraints, {});
  EXPECT_THAT((*preparation)->Contact(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("contact row 2 cannot move")));
}

}  // namespace
}  // namespace tissueform
