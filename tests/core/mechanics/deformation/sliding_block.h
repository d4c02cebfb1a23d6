// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {

// A block of 3 x 3 x 4 mm on z = 0, held there. A bone lies on its top, of which one corner sticks
// to it; a part of the rest slides and a part may lift off. Another part touches the block's side
// with itself, in pairs.
class SlidingBlock {
 public:
  static constexpr int kBone = 0;  // the first handle

  explicit SlidingBlock(bool only_bilateral = false) : mesh_(Bar({3, 3, 4}, 1.0, 0.15)) {
    std::mt19937 generator(4);
    std::uniform_real_distribution<double> number(-0.3, 0.3);
    fixed_ = SelectVertices(mesh_, [](const auto& x) { return x.z() < 0.5; });
    held_ = SelectVertices(mesh_, [](const auto& x) { return x.z() > 3.5 && x.x() > 2.5; });
    for (const int32_t v :
         SelectVertices(mesh_, [](const auto& x) { return x.z() > 3.5 && x.x() < 2.5; })) {
      const bool bilateral = mesh_.positions()(v, 0) > 0.5;
      rows_.push_back(
          {.vertex = v,
           .handle = kBone,
           .normal = Eigen::Vector3d(number(generator), number(generator), -1).normalized(),
           .gap_mm = bilateral ? 0.0 : 0.02 * v / 80,
           .bilateral = bilateral});
    }
    const auto side = SelectVertices(mesh_, [](const auto& x) {
      return x.y() < 0.5 && x.x() > 0.5 && x.z() > 0.5 && x.z() < 3.5;
    });
    for (size_t i = 0; i + 1 < side.size(); i += 2) {
      rows_.push_back(
          {.vertex = side[i],
           .other = side[i + 1],
           .normal =
               (mesh_.positions().row(side[i]) - mesh_.positions().row(side[i + 1])).normalized()});
    }
    if (only_bilateral) std::erase_if(rows_, [](const auto& row) { return !row.bilateral; });
  }

  std::shared_ptr<MeshPreparation> Prepare() const {
    const Eigen::VectorXd stiffness = Eigen::VectorXd::LinSpaced(mesh_.num_tets(), 5000, 20000);
    return *MeshPreparation::Create(
        mesh_, stiffness, *ConstraintSet::Create(mesh_, fixed_, {{"bone", held_}}, rows_), {});
  }

  // Every row with two more across it. REQUIRES: only_bilateral.
  SlidingBlock WithRowsInAllDirections() const {
    SlidingBlock block(*this);
    for (const ContactRow& row : rows_) {
      ContactRow across = row;
      across.normal = row.normal.unitOrthogonal();
      block.rows_.push_back(across);
      across.normal = row.normal.cross(across.normal);
      block.rows_.push_back(across);
    }
    return block;
  }
  // The same vertices as a part of the handle.
  SlidingBlock Sticking() const {
    SlidingBlock block(*this);
    for (const ContactRow& row : rows_) block.held_.push_back(row.vertex);
    block.rows_ = {};
    return block;
  }

  const TetMesh mesh_;
  std::vector<int32_t> fixed_;
  std::vector<int32_t> held_;
  std::vector<ContactRow> rows_;
};

inline HandlePose RandomPose(std::mt19937* generator) {
  std::uniform_real_distribution<double> number(-0.4, 0.4);
  HandlePose pose;
  pose.pivot_mm = {2, 1, 4};
  pose.translation_mm = {number(*generator), number(*generator), number(*generator)};
  pose.rotation_vector = {number(*generator), number(*generator), number(*generator)};
  return pose;
}

// Gaps of displacements by the definition of ContactRow; with normals that turn with their bone, by
// that of TurningContact.
inline Eigen::VectorXd GapsOf(const MeshPreparation& preparation, const Positions& moved,
                              const HandlePose& pose, bool normals_turn = false) {
  const std::vector<ContactRow>& rows = preparation.constraints().contact();
  Eigen::VectorXd gaps(static_cast<Eigen::Index>(rows.size()));
  for (size_t r = 0; r < rows.size(); ++r) {
    const Eigen::Vector3d place = preparation.mesh().positions().row(rows[r].vertex);
    const bool on_handle = rows[r].handle != ContactRow::kFixedBone;
    Eigen::Vector3d other = Eigen::Vector3d::Zero();
    if (on_handle) other = ApplyPose(pose, place) - place;
    if (rows[r].other != ContactRow::kBone) other = moved.row(rows[r].other);
    const bool turns = normals_turn && on_handle;
    const Eigen::Vector3d normal =
        turns ? RotationMatrix(pose.rotation_vector) * rows[r].normal : rows[r].normal;
    gaps[static_cast<Eigen::Index>(r)] =
        normal.dot(moved.row(rows[r].vertex).transpose() - other) + rows[r].gap_mm;
  }
  return gaps;
}

// How exactly a model meets its rows, in mm.
struct RowTolerances {
  bool normals_turn = false;
  double bilateral = 0;
  double penetration = 0;
  double reported_gap = 0;  // between a gap and ContactAnswer::gaps_mm
  double residual = 0;
};

// In 200 poses of the block's bone, in a quarter of which or more some rows press and some do not.
inline void ExpectRowsHoldInEveryPose(const DeformerOptions& options,
                                      const RowTolerances& tolerances) {
  const auto preparation = SlidingBlock().Prepare();
  const std::vector<ContactRow>& rows = preparation->constraints().contact();
  const auto deformer = *CreateDeformer(preparation, options);
  std::mt19937 generator(7);
  size_t some_open = 0;
  for (int i = 0; i < 200; ++i) {
    const HandlePose pose = RandomPose(&generator);
    const Deformation answer = *deformer->Deform({pose});
    ASSERT_TRUE(answer.summary.converged) << i;
    const Eigen::VectorXd gaps =
        GapsOf(*preparation, answer.positions - preparation->mesh().positions(), pose,
               tolerances.normals_turn);
    size_t unilateral = 0;
    for (size_t r = 0; r < rows.size(); ++r) {
      const double gap = gaps[static_cast<Eigen::Index>(r)];
      if (rows[r].bilateral) {
        EXPECT_NEAR(gap, 0, tolerances.bilateral);
      } else {
        EXPECT_GE(gap, -tolerances.penetration);
        EXPECT_NEAR(gap, answer.contact.gaps_mm[unilateral++], tolerances.reported_gap);
      }
    }
    EXPECT_THAT(answer.contact.forces, ::testing::Each(::testing::Ge(0)));
    EXPECT_LT(answer.contact.residual_mm, tolerances.residual);
    const auto open = std::ranges::count(answer.contact.forces, 0.0);
    some_open += open > 0 && open < static_cast<std::ptrdiff_t>(unilateral) ? 1 : 0;
  }
  EXPECT_GT(some_open, 50U) << "the poses do not open the contact in part";
}

}  // namespace tissueform::testing
