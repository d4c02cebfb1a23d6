// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/trial_solve.h"

#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

// A bar of 4 by 4 by 10 mm, held at its lower end and moved at the other, and at one vertex close
// to the lower end, which a move down pushes through it.
class ContactTrialTest : public ::testing::Test {
 protected:
  ContactTrialTest() {
    regions_.anatomy.assign(static_cast<size_t>(mesh_.num_vertices()), 0);
    for (Eigen::Index v = 0; v < mesh_.num_vertices(); ++v) {
      const Eigen::Vector3d p = mesh_.positions().row(v);
      if (p.z() == 0) regions_.anatomy[v] = kFixedBone;
      if (p.z() == 10 || p == Eigen::Vector3d(2, 2, 1)) regions_.anatomy[v] = kFirstSegment;
    }
  }

  absl::StatusOr<int64_t> Release(double down_mm, int threads = 2) {
    HandlePose pose;
    pose.translation_mm.z() = -down_mm;
    TF_ASSIGN_OR_RETURN(ContactRelaxation released,
                        ReleaseTornContacts({.mesh = mesh_,
                                             .youngs_modulus_pa = stiffness_,
                                             .poisson_ratio = 0.3,
                                             .poses = {pose},
                                             .threads = threads},
                                            regions_));
    regions_ = std::move(released.regions);
    num_inverted_ = released.num_inverted;
    return released.freed;
  }

  std::vector<int32_t> VerticesWith(uint8_t label) const {
    std::vector<int32_t> vertices;
    for (size_t v = 0; v < regions_.anatomy.size(); ++v) {
      if (regions_.anatomy[v] == label) vertices.push_back(static_cast<int32_t>(v));
    }
    return vertices;
  }

  Eigen::Index InvertedTets(DeformationModel model, double down_mm) const {
    const auto constraints = ConstraintSet::Create(mesh_, VerticesWith(kFixedBone),
                                                   {{"piece", VerticesWith(kFirstSegment)}});
    DeformerOptions options;
    options.model = model;
    HandlePose pose;
    pose.translation_mm.z() = -down_mm;
    const auto deformer = CreateDeformer(mesh_, Eigen::VectorXd::Constant(mesh_.num_tets(), 1e4),
                                         *constraints, options);
    const Positions deformed = (*deformer)->Deform({pose})->positions;
    return MeasureDeformation(mesh_, deformed).inverted_tets;
  }

  const TetMesh mesh_ = testing::Bar({4, 4, 10});
  std::vector<double> stiffness_ = std::vector<double>(static_cast<size_t>(mesh_.num_tets()), 1e4);
  PlanningRegions regions_;
  int64_t num_inverted_ = -1;
};

TEST_F(ContactTrialTest, ReleasesTearingContactsAndHoldsTheRest) {
  ASSERT_GT(InvertedTets(DeformationModel::kGradientField, 2), 0);
  const size_t fixed_before = VerticesWith(kFixedBone).size();
  ASSERT_OK_AND_ASSIGN(const int64_t freed, Release(2));
  EXPECT_GT(freed, 0);
  EXPECT_EQ(regions_.freed_by_contact, freed);
  EXPECT_EQ(num_inverted_, 0);
  for (const auto model : {DeformationModel::kGradientField, DeformationModel::kLinearElastic,
                           DeformationModel::kArap, DeformationModel::kNeoHookean}) {
    for (const double down_mm : {2.0, 8.0 / 3}) {
      EXPECT_EQ(InvertedTets(model, down_mm), 0) << static_cast<int>(model) << " " << down_mm;
    }
  }
  EXPECT_EQ(VerticesWith(kFirstSegment).size(), 25U);  // its own end
  EXPECT_GT(VerticesWith(kFixedBone).size(), fixed_before / 2);
}

TEST_F(ContactTrialTest, NothingIsReleasedWhereNothingTears) {
  const std::vector<uint8_t> before = regions_.anatomy;
  ASSERT_OK_AND_ASSIGN(const int64_t freed, Release(0.3));
  EXPECT_EQ(freed, 0);
  EXPECT_EQ(regions_.anatomy, before);
  ASSERT_OK_AND_ASSIGN(const int64_t at_rest, Release(0));
  EXPECT_EQ(at_rest, 0);
}

TEST_F(ContactTrialTest, ReleasedContactsDoNotDependOnThreads) {
  const PlanningRegions before = regions_;
  ASSERT_OK_AND_ASSIGN(const int64_t freed, Release(2, 1));
  const std::vector<uint8_t> by_one = regions_.anatomy;
  for (const int threads : {2, 3}) {
    regions_ = before;
    ASSERT_OK_AND_ASSIGN(const int64_t again, Release(2, threads));
    EXPECT_EQ(again, freed);
    EXPECT_EQ(regions_.anatomy, by_one);
  }
}

// One vertex in a stiff lump is moved, and squeezes a soft layer under it that touches nothing
// held.
TEST_F(ContactTrialTest, ReleasesADistantContactThatTearsATet) {
  const Eigen::Vector3d lone(2, 2, 5);
  for (Eigen::Index v = 0; v < mesh_.num_vertices(); ++v) {
    const Eigen::Vector3d p = mesh_.positions().row(v);
    regions_.anatomy[v] = p.z() == 0 ? kFixedBone : p.z() == 10 || p == lone ? kFirstSegment : 0;
  }
  for (Eigen::Index t = 0; t < mesh_.num_tets(); ++t) {
    double z = 0;
    bool in_lump = false;
    for (const int32_t v : mesh_.tets().row(t)) {
      z += mesh_.positions()(v, 2) / 4;
      in_lump |= mesh_.positions().row(v).transpose() == lone;
    }
    stiffness_[t] = in_lump || z < 2 ? 1e7 : z < 4 ? 1e4 : z < 6 ? 1e3 : 1e2;
  }
  ASSERT_OK_AND_ASSIGN(const int64_t freed, Release(2.2));
  EXPECT_EQ(freed, 1);
  EXPECT_EQ(num_inverted_, 0);
  EXPECT_EQ(VerticesWith(kFirstSegment).size(), 25U);
}

TEST_F(ContactTrialTest, MovesThatTearEverythingAreRefused) {
  EXPECT_THAT(Release(40), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("plan smaller")));
}

}  // namespace
}  // namespace tissueform
