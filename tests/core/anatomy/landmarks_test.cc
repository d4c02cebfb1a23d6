// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/anatomy/landmarks.h"

#include "core/ct/ct_volume_reader.h"
#include "core/ct/isotropic_resample.h"
#include "tests/core/anatomy/head_phantom.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::HeadPhantom;
using testing::StatusIs;
using testing::TestDataPath;

absl::StatusOr<Landmarks> LandmarksOf(const HuGrid& ct) {
  const absl::StatusOr<HeadSegmentation> head = SegmentHead(ct);
  if (!head.ok()) return head.status();
  const absl::StatusOr<BoneParts> parts = SeparateBoneParts(*head);
  if (!parts.ok()) return parts.status();
  return FindLandmarks(*head, *parts);
}

void ExpectNear(const Eigen::Vector3d& found, const Eigen::Vector3d& expected, double mm,
                const char* name) {
  EXPECT_LT((found - expected).norm(), mm)
      << name << " at " << found.transpose() << ", expected " << expected.transpose();
}

TEST(LandmarksTest, ThoseOfThePhantomAreWhereItsSolidsSay) {
  ASSERT_OK_AND_ASSIGN(const Landmarks l, LandmarksOf(HeadPhantom()));
  constexpr double kVoxelMm = 2;
  EXPECT_GT(l.midsagittal.normal.x(), 0.9995);
  EXPECT_NEAR(l.midsagittal.HeightMm(Eigen::Vector3d(0, -50, -50)), 0, kVoxelMm);
  EXPECT_NEAR(l.menton.z(), testing::kPhantomMentonMm, kVoxelMm);
  EXPECT_NEAR(l.pogonion.y(), testing::kPhantomPogonionMm, 1.5 * kVoxelMm);
  EXPECT_NEAR(l.upper_incisor.z(), testing::kPhantomUpperTeethMm, kVoxelMm);
  EXPECT_NEAR(l.lower_incisor.z(), testing::kPhantomUpperTeethMm - 6, kVoxelMm);
  ExpectNear(l.condyle.left, {45, 11, testing::kPhantomCondyleMm}, 2 * kVoxelMm, "left condyle");
  ExpectNear(l.condyle.right, {-45, 11, testing::kPhantomCondyleMm}, 2 * kVoxelMm, "right condyle");
  EXPECT_NEAR(l.nasal_floor.z(), testing::kPhantomPalateMm, 1.5 * kVoxelMm);
  EXPECT_NEAR(l.ramus_front.left.y(), -10, kVoxelMm);
  EXPECT_NEAR(l.occlusal.HeightMm(Eigen::Vector3d(0, -60, -44)), 0, kVoxelMm);
  EXPECT_GT(l.occlusal.normal.z(), 0.999);
  EXPECT_NEAR(l.nose_tip.y(), testing::kPhantomNoseTipMm, kVoxelMm);
  EXPECT_NEAR(l.nose_tip.z(), testing::kPhantomNoseHeightMm, 3 * kVoxelMm);
  EXPECT_GT(l.upper_lip.z(), -44);
  EXPECT_LT(l.lower_lip.z(), -47);
}

TEST(LandmarksTest, FrontIsSquareToUpAndToTheMidline) {
  ASSERT_OK_AND_ASSIGN(const Landmarks l, LandmarksOf(HeadPhantom()));
  const Eigen::Vector3d front = l.ForwardOf(l.upper_teeth);
  EXPECT_NEAR(front.dot(l.upper_teeth.normal), 0, 1e-12);
  EXPECT_NEAR(front.dot(l.midsagittal.normal), 0, 1e-12);
  EXPECT_LT(front.y(), -0.99);
}

// A living patient, mouth open, head tilted back; places as seen in pictures of the slices, in the
// file's frame (x = -201.6 .. 0, z = -138 .. 0). The patient's voxels are 3.2 mm wide.
TEST(LandmarksTest, ThoseOfALivingHeadAreWherePicturesShowThem) {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  ASSERT_OK_AND_ASSIGN(const CtVolume volume,
                       ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options));
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, ResampleIsotropic(volume, 2.5));
  ASSERT_OK_AND_ASSIGN(const Landmarks l, LandmarksOf(ct));
  ExpectNear(l.pogonion, {-97, 60, -127}, 6, "pogonion");
  ExpectNear(l.menton, {-97, 72, -133}, 6, "menton");
  ExpectNear(l.upper_incisor, {-97, 43, -96}, 6, "upper incisor");
  ExpectNear(l.lower_incisor, {-98, 53, -102}, 7, "lower incisor");
  ExpectNear(l.condyle.left, {-51, 104, -32}, 7, "left condyle");
  ExpectNear(l.condyle.right, {-140, 106, -37}, 7, "right condyle");
  ExpectNear(l.nose_tip, {-97, 18, -72}, 7, "nose tip");
  ExpectNear(l.upper_lip, {-97, 27, -90}, 7, "upper lip");
  ExpectNear(l.lower_lip, {-97, 39, -109}, 7, "lower lip");
  EXPECT_NEAR(l.nasal_floor.z(), -63, 6);
  EXPECT_GT(l.nose_prominence_mm, 5);
  EXPECT_LT(l.nose_prominence_mm, 20);
}

TEST(LandmarksTest, WhatIsNotInViewIsNamed) {
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(HeadPhantom()));
  ASSERT_OK_AND_ASSIGN(BoneParts parts, SeparateBoneParts(head));
  for (uint8_t& label : parts.labels.values) {
    if (label == kCranium) label = 0;
  }
  EXPECT_THAT(FindLandmarks(head, parts),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("upper front teeth")));
  for (uint8_t& label : parts.labels.values) label = 0;
  EXPECT_THAT(FindLandmarks(head, parts),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no lower jaw")));
}

}  // namespace
}  // namespace tissueform
