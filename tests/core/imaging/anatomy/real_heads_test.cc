// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// All of the anatomy on CTs of people: what pictures of them show.

#include <cmath>
#include <itkMultiThreaderBase.h>
#include <string>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/mouth_line.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/scanner_cut.h"
#include "core/imaging/anatomy/soft_tissue.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "core/imaging/ct/unscanned.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/unpacked_archive.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::SharedDataPath;
using testing::StatusIs;
using testing::TestDataPath;
using testing::UnpackedArchive;

struct Anatomy {
  HeadSegmentation head;
  BoneParts parts;
  Landmarks landmarks;
  LabelGrid bone;
  SoftTissue soft;
};

absl::StatusOr<HuGrid> LivingHead(double spacing_mm) {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  TF_ASSIGN_OR_RETURN(const CtVolume volume,
                      ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options));
  return ResampleIsotropic(volume, spacing_mm);
}

// With the jaw, the upper jaw and the chin as segments 2, 3 and 4.
absl::StatusOr<Anatomy> AnatomyOf(const HuGrid& ct) {
  Anatomy a;
  TF_ASSIGN_OR_RETURN(a.head, SegmentHead(ct));
  TF_ASSIGN_OR_RETURN(a.parts, SeparateBoneParts(a.head));
  TF_ASSIGN_OR_RETURN(a.landmarks, FindLandmarks(a.head, a.parts));
  std::vector<OsteotomySegment> segments;
  for (const OsteotomyKind kind :
       {OsteotomyKind::kBssro, OsteotomyKind::kLeFort1, OsteotomyKind::kGenioplasty}) {
    segments.push_back(DefaultSegment(kind, OsteotomyKindName(kind), a.landmarks));
  }
  TF_ASSIGN_OR_RETURN(a.bone, CutSegments(a.parts.labels, segments));
  const RegionOfInterest region = DefaultRegion(a.landmarks, a.bone.geometry);
  TF_ASSIGN_OR_RETURN(a.soft, ExtractSoftTissue(a.head, a.bone, a.landmarks, region));
  return a;
}

double VolumeCm3(const LabelGrid& labels, uint8_t label) {
  const LabelGrid mask = MaskWhere(labels, [=](uint8_t value) { return value == label; });
  return static_cast<double>(CountVoxels(mask)) * VoxelVolumeMm3(labels.geometry) / 1e3;
}

// The label of bone nearest to a place, within 6 mm.
int LabelNear(const LabelGrid& labels, const Eigen::Vector3d& place) {
  double nearest_mm = 6;
  int label = 0;
  ForEachVoxel(labels, [&](size_t index, const Eigen::Vector3d& voxel) {
    const double mm = (voxel - place).norm();
    if (mm >= nearest_mm) return;
    nearest_mm = mm;
    label = labels.values[index];
  });
  return label;
}

// Left and right halves of a segment differ by less than that share.
void ExpectEven(const Anatomy& a, uint8_t segment, double share) {
  double left = 0;
  double all = 0;
  ForEachVoxel(a.bone, [&](size_t index, const Eigen::Vector3d& place) {
    if (a.bone.values[index] != segment) return;
    ++all;
    if (a.landmarks.midsagittal.HeightMm(place) > 0) ++left;
  });
  EXPECT_NEAR(left / all, 0.5, share / 2) << "segment " << int{segment};
}

void ExpectBonesWhereTheyBelong(const Anatomy& a, double share) {
  EXPECT_EQ(LabelNear(a.bone, a.landmarks.lower_incisor), 2);
  EXPECT_EQ(LabelNear(a.bone, a.landmarks.upper_incisor), 3);
  EXPECT_EQ(LabelNear(a.bone, a.landmarks.menton), 4);
  for (const LeftAndRight& pair : {a.landmarks.condyle, a.landmarks.gonion}) {
    EXPECT_EQ(LabelNear(a.bone, pair.left), kFixedBone);
    EXPECT_EQ(LabelNear(a.bone, pair.right), kFixedBone);
  }
  ExpectEven(a, 2, share);
  ExpectEven(a, 3, share);
}

TEST(RealHeadsTest, ALivingHeadWithOpenMouthIsTakenApart) {
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, LivingHead(2.5));
  ASSERT_OK_AND_ASSIGN(const Anatomy a, AnatomyOf(ct));
  EXPECT_EQ(a.parts.separation, JawSeparation::kThreshold);
  EXPECT_GT(a.parts.confidence, 0.95);
  EXPECT_LT(a.head.bare_fraction, 0.2);
  EXPECT_NEAR(VolumeCm3(a.parts.labels, kMandible), 84, 8);
  // Widths of an adult's jaw: joints 80 to 130 mm apart, which lie 70 to 125 mm from the chin.
  const LeftAndRight& condyle = a.landmarks.condyle;
  EXPECT_NEAR((condyle.left - condyle.right).norm(), 90, 6);
  EXPECT_NEAR((condyle.left - a.landmarks.menton).norm(), 116, 8);
  EXPECT_NEAR((condyle.right - a.landmarks.menton).norm(), 116, 8);
  ExpectBonesWhereTheyBelong(a, 0.15);
  EXPECT_NEAR(a.soft.volume_mm3 / 1e3, 770, 60);
}

// It leaves the mouth and runs down before the left half of the chin: -89, 46, -132 in the file's
// frame.
TEST(RealHeadsTest, TheBreathingTubeIsReplacedByAir) {
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, LivingHead(2.5));
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  const Eigen::Vector3d tube(-89, 44, -130);
  int tissue_before = 0;
  int tissue_after = 0;
  ForEachVoxel(LabelGrid(ct.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
    if ((place - tube).norm() > 6) return;
    if (ct.values[index] > head.options.tissue_above_hu) ++tissue_before;
    if (Interpolate(head.hu, place) > head.options.tissue_above_hu) ++tissue_after;
  });
  EXPECT_GT(tissue_before, 8);
  EXPECT_LT(tissue_after, tissue_before / 3);
}

// The skin that it lies on: from the lip over the chin to the lower border.
TEST(RealHeadsTest, ReportsTheBreathingTubeWithItsPlace) {
  for (const double spacing_mm : {1.5, 2.0}) {
    SCOPED_TRACE(spacing_mm);
    ASSERT_OK_AND_ASSIGN(const HuGrid ct, LivingHead(spacing_mm));
    ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
    ASSERT_EQ(head.objects.size(), 1U);
    const AttachedObject& tube = head.objects.front();
    EXPECT_EQ(tube.kind, ObjectKind::kTube);
    EXPECT_NEAR(tube.volume_mm3, 1850, 400);
    EXPECT_LT((tube.middle_mm - Eigen::Vector3d(-88, 44, -117)).norm(), 8);
    EXPECT_GT(static_cast<double>(tube.contact_mm.size()) * tube.face_mm2, 200);
    for (const Eigen::Vector3d& place : tube.contact_mm) {
      EXPECT_LT(std::hypot(place.x() + 88, place.y() - 46), 15);
    }
  }
}

// They are 4 mm thin, and fall off with cords when the head is opened by a ball of 4 mm.
TEST(RealHeadsTest, TheEarsAreKept) {
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, LivingHead(2));
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  int64_t tissue = 0;
  int64_t kept = 0;
  ForEachVoxel(LabelGrid(ct.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
    const bool at_ear = (place.x() > -29 || place.x() < -167) && place.y() > 104 &&
                        place.y() < 131 && place.z() > -62 && place.z() < -10;
    if (!at_ear || ct.values[index] <= head.options.tissue_above_hu) return;
    ++tissue;
    if (Interpolate(head.hu, place) > head.options.tissue_above_hu) ++kept;
  });
  EXPECT_GT(static_cast<double>(tissue) * 8, 8000);
  EXPECT_GT(kept, tissue * 99 / 100);
}

// Thin skin is thickened into bone; a segment lies deeper, and what its handle holds is its
// surface. Teeth that the open mouth shows are blurred at their edges, and are no skin all the
// same.
TEST(RealHeadsTest, ThickeningLeavesTheSegmentsBone) {
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, LivingHead(2));
  ASSERT_OK_AND_ASSIGN(const Anatomy a, AnatomyOf(ct));
  std::vector<int64_t> voxels(kFirstSegment + 3);
  std::vector<int64_t> eaten(voxels.size());
  ForEachVoxel(LabelGrid(a.soft.labels.geometry, 1), [&](size_t index, const Eigen::Vector3d& p) {
    const Eigen::Vector3i at = a.bone.geometry.ToVoxels(p).array().round().matrix().cast<int>();
    const uint8_t label = a.bone.At(at.x(), at.y(), at.z());
    ++voxels[label];
    if (a.soft.labels.values[index] == kSoftTissue) ++eaten[label];
  });
  for (size_t label = kFirstSegment; label < voxels.size(); ++label) {
    SCOPED_TRACE(label);
    EXPECT_GT(voxels[label], 500);
    EXPECT_LT(static_cast<double>(eaten[label]) / static_cast<double>(voxels[label]), 0.004);
  }
}

TEST(RealHeadsTest, AHeadCutOffOverTheJawIsRefused) {
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, LivingHead(2.5));
  VoxelBox upper;
  upper.last = {ct.geometry.size[0] - 1, ct.geometry.size[1] - 1, ct.geometry.size[2] - 1};
  upper.first[2] = static_cast<int>(ct.geometry.ToVoxels({0, 0, -72}).z());  // over the upper teeth
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(Crop(ct, upper)));
  EXPECT_THAT(SeparateBoneParts(head),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no lower jaw in view")));
}

TEST(RealHeadsTest, ResultsDoNotDependOnTheNumberOfThreads) {
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, LivingHead(3.2));
  const auto threads = itk::MultiThreaderBase::GetGlobalDefaultNumberOfThreads();
  itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(1);
  const absl::StatusOr<Anatomy> one = AnatomyOf(ct);
  itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(3);
  const absl::StatusOr<Anatomy> three = AnatomyOf(ct);
  itk::MultiThreaderBase::SetGlobalDefaultNumberOfThreads(threads);
  ASSERT_TRUE(one.ok()) << one.status();
  ASSERT_TRUE(three.ok()) << three.status();
  EXPECT_EQ(one->soft.field.values, three->soft.field.values);
  EXPECT_EQ(one->soft.labels.values, three->soft.labels.values);
  EXPECT_EQ(one->landmarks.nose_tip, three->landmarks.nose_tip);
}

// From the shoulders to the eyes. Upper and lower teeth touch, and fillings throw streaks.
TEST(RealHeadsTest, ACadaverWithTeethInOcclusionIsTakenApart) {
  const std::string archive = SharedDataPath("ct_head_vhm_dicom/vhm_head_dicom.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "the shared data sets are not here";
  const UnpackedArchive files(archive, "'vhm_head/vhm.10[2-9]*' 'vhm_head/vhm.11[0-6]*'");
  ASSERT_TRUE(files.ok());
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, ReadCtVolume(files.Path("vhm_head")));
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, ResampleIsotropic(volume, 2.5));
  ASSERT_OK_AND_ASSIGN(const Anatomy a, AnatomyOf(ct));
  EXPECT_EQ(a.parts.separation, JawSeparation::kAutomaticCut);
  EXPECT_GT(a.parts.confidence, 0.9);
  EXPECT_NEAR(VolumeCm3(a.parts.labels, kMandible), 68, 8);
  EXPECT_NEAR((a.landmarks.condyle.left - a.landmarks.condyle.right).norm(), 98, 8);
  EXPECT_LT(a.landmarks.nose_prominence_mm, 2);  // the CT's circle has cut the nose off
  ExpectBonesWhereTheyBelong(a, 0.35);           // teeth are missing on the left

  ASSERT_OK_AND_ASSIGN(const LabelGrid unscanned, ResampleUnscanned(volume, 2.5, 2));
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct, {}, nullptr, {}, unscanned));
  const std::vector<Plane> planes = DefaultRegion(a.landmarks, head.head.geometry).planes();
  const std::vector<ScannerCut> cuts = MeasureCuts(head.cut, head.head, planes, a.landmarks);
  ASSERT_FALSE(cuts.empty());
  EXPECT_NEAR(cuts[0].middle.y(), 145, 4);  // the row that the circle reaches, in pixels of 1 mm
  EXPECT_GT(cuts[0].region_mm2[static_cast<size_t>(SkinRegion::kNose)], 200);

  // By eye the closed lips meet at 253, 138, 1075.7; a moustache hides both corners.
  ASSERT_OK_AND_ASSIGN(const MouthLine mouth, FindMouthLine(head, a.landmarks));
  const FaceAxes axes(a.landmarks);
  for (const MouthLinePoint& point : mouth.points) {
    if (std::abs(point.at.left) > 10) continue;
    EXPECT_NEAR(axes.Place(point.at).z(), 1076, 2) << point.at.left;
  }
  EXPECT_EQ(mouth.right_corner, MouthCornerReason::kNoNotch);
  EXPECT_EQ(mouth.left_corner, MouthCornerReason::kNoNotch);
}

// Tilted slices of two distances, from the upper jaw up.
TEST(RealHeadsTest, RefusesAHeadWithoutABodyOfTheJaw) {
  const std::string archive =
      SharedDataPath("ct_dicom_ge_two_thicknesses/ge_two_thicknesses.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "the shared data sets are not here";
  const UnpackedArchive files(archive, "'*'");
  ASSERT_TRUE(files.ok());
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, ReadCtVolume(files.Path("")));
  EXPECT_EQ(volume.slice_origins_mm.size(), 28U);
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, ResampleIsotropic(volume, 2));
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  EXPECT_THAT(SeparateBoneParts(head),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no lower jaw in view")));
}

// The bundled head as such a CT: without its lower half, thin slices and then thick ones.
TEST(RealHeadsTest, RefusesUnevenSlicesWithoutAJaw) {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  ASSERT_OK_AND_ASSIGN(const CtVolume whole,
                       ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options));
  CtVolume upper = whole;
  upper.hu.clear();
  const auto slice = static_cast<int64_t>(whole.size[0]) * whole.size[1];
  for (int k = 0; k < 52; k += k < 28 ? 4 : 2) {
    upper.slice_origins_mm.push_back(whole.Place(0, 0, k));
    upper.hu.insert(upper.hu.end(), whole.hu.begin() + k * slice,
                    whole.hu.begin() + (k + 1) * slice);
  }
  upper.size[2] = static_cast<int>(upper.slice_origins_mm.size());
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, ResampleIsotropic(upper, 2));
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  EXPECT_THAT(SeparateBoneParts(head),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no lower jaw in view")));
}

TEST(RealHeadsTest, RefusesAPlasticSkullWithoutSkin) {
  const std::string archive =
      SharedDataPath("ct_dicom_philips_tilt/philips_plastic_skull_tilt.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "the shared data sets are not here";
  const UnpackedArchive files(archive, "'*'");
  ASSERT_TRUE(files.ok());
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, ReadCtVolume(files.Path("S2010")));
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, ResampleIsotropic(volume, 2));
  EXPECT_THAT(SegmentHead(ct), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no skin")));
}

}  // namespace
}  // namespace tissueform
