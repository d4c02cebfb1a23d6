// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/metal_in_bone.h"

#include <cmath>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/landmarks.h"
#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::HeadPhantom;

constexpr int16_t kMetalHu = 3071;
constexpr int16_t kStreakHu = 600;

struct Anatomy {
  HeadSegmentation head;
  BoneParts parts;
  Landmarks landmarks;
};

absl::StatusOr<Anatomy> AnatomyOf(const HuGrid& ct, const LabelGrid& metal = {}) {
  Anatomy a;
  TF_ASSIGN_OR_RETURN(a.head, SegmentHead(ct, {}, nullptr, metal));
  TF_ASSIGN_OR_RETURN(a.parts, SeparateBoneParts(a.head));
  TF_ASSIGN_OR_RETURN(a.landmarks, FindLandmarks(a.head, a.parts));
  return a;
}

// The phantom with dense blocks in it, and where those of metal are.
struct Patient {
  HuGrid ct = HeadPhantom();
  LabelGrid metal = LabelGrid(ct.geometry);

  void Put(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int16_t hu) {
    ForEachVoxel(LabelGrid(ct.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
      if ((place.array() < low.array()).any() || (place.array() > high.array()).any()) return;
      ct.values[index] = hu;
      metal.values[index] = hu == kMetalHu ? 1 : 0;
    });
  }
};

// On the left molars of both jaws, whose rows end at -41 and -47 mm, through the gap between them.
Patient WithFillingsThatBite() {
  Patient patient;
  patient.Put({22, -44, -52}, {30, -30, -36}, kMetalHu);
  return patient;
}

// A ledge of one voxel, from the molars through the cheek to the skin.
Patient WithStreak() {
  Patient patient;
  patient.Put({24, -40, -50}, {30, -32, -46}, kMetalHu);
  patient.Put({31, -40, -49}, {62, -30, -47.5}, kStreakHu);
  return patient;
}

void ExpectSameWithin(double mm, const Landmarks& a, const Landmarks& b) {
  EXPECT_LT((a.lower_incisor - b.lower_incisor).norm(), mm);
  EXPECT_LT((a.upper_incisor - b.upper_incisor).norm(), mm);
  for (const auto member : {&LeftAndRight::left, &LeftAndRight::right}) {
    EXPECT_LT((a.lower_molar.*member - b.lower_molar.*member).norm(), mm);
    EXPECT_LT((a.upper_molar.*member - b.upper_molar.*member).norm(), mm);
    EXPECT_LT((a.ramus_front.*member - b.ramus_front.*member).norm(), mm);
    EXPECT_LT((a.gonion.*member - b.gonion.*member).norm(), mm);
  }
}

TEST(MetalInBoneTest, AFillingIsNotMistakenForALandmark) {
  ASSERT_OK_AND_ASSIGN(const Anatomy truth, AnatomyOf(HeadPhantom()));
  const Patient patient = WithFillingsThatBite();
  ASSERT_OK_AND_ASSIGN(const Anatomy found, AnatomyOf(patient.ct, patient.metal));
  EXPECT_EQ(found.parts.separation, JawSeparation::kThreshold);
  // Half the gap of 6 mm, which the fillings share, and a voxel.
  ExpectSameWithin(5, found.landmarks, truth.landmarks);
}

TEST(MetalInBoneTest, FillingsThatBiteOnEachOtherDoNotJoinTheJaws) {
  ASSERT_OK_AND_ASSIGN(const Anatomy truth, AnatomyOf(HeadPhantom()));
  const Patient patient = WithFillingsThatBite();
  ASSERT_OK_AND_ASSIGN(const Anatomy found, AnatomyOf(patient.ct, patient.metal));
  for (size_t i = 0; i < truth.parts.labels.values.size(); ++i) {
    if (found.head.metal.values[i] != 0) continue;
    ASSERT_EQ(found.parts.labels.values[i], truth.parts.labels.values[i]);
  }
  // Without the mask they do: the jaws are one piece, and have to be cut.
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(patient.ct));
  ASSERT_OK_AND_ASSIGN(const BoneParts joined, SeparateBoneParts(head));
  EXPECT_EQ(joined.separation, JawSeparation::kAutomaticCut);
}

TEST(MetalInBoneTest, ABracketBelongsToTheJawOfItsTooth) {
  Patient patient;
  patient.Put({2, -68, -40}, {6, -63, -36}, kMetalHu);  // on an upper front tooth
  patient.Put({2, -68, -54}, {6, -63, -50}, kMetalHu);  // on a lower one
  ASSERT_OK_AND_ASSIGN(const Anatomy found, AnatomyOf(patient.ct, patient.metal));
  int seen = 0;
  ForEachVoxel(found.head.metal, [&](size_t index, const Eigen::Vector3d& place) {
    ++seen;
    EXPECT_EQ(found.parts.labels.values[index], place.z() > -45 ? kCranium : kMandible);
  });
  EXPECT_GT(seen, 20);
}

int64_t BoneInCheek(const HeadSegmentation& head) {
  int64_t count = 0;
  ForEachVoxel(head.bone, [&](size_t, const Eigen::Vector3d& place) {
    if (place.x() > 35 && place.y() < -20 && place.z() < -40 && place.z() > -52) ++count;
  });
  return count;
}

TEST(MetalInBoneTest, StreakIsNotMistakenForBone) {
  const Patient patient = WithStreak();
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation spoilt, SegmentHead(patient.ct));
  EXPECT_GT(BoneInCheek(spoilt), 50);
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation found,
                       SegmentHead(patient.ct, {}, nullptr, patient.metal));
  EXPECT_EQ(BoneInCheek(found), 0);
  EXPECT_GT(found.streaks_mm3, 500);
}

TEST(MetalInBoneTest, WithoutMetalNothingIsTakenAway) {
  Patient patient;
  patient.Put({31, -40, -49}, {62, -30, -47.5}, kStreakHu);
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation with_mask,
                       SegmentHead(patient.ct, {}, nullptr, patient.metal));
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation without, SegmentHead(patient.ct));
  EXPECT_EQ(with_mask.bone.values, without.bone.values);
  EXPECT_EQ(with_mask.hu.values, without.hu.values);
  EXPECT_EQ(with_mask.streaks_mm3, 0);
}

}  // namespace
}  // namespace tissueform
