// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/labelled_head.h"

#include <array>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/anatomy/label_fit.h"

namespace tissueform::testing {
namespace {

constexpr int kSize = 12;
const GridGeometry kGrid{.size = {kSize, kSize, kSize}, .spacing_mm = 1};
constexpr int16_t kTissueHu = 40;
constexpr int16_t kBoneHu = 1000;
constexpr int16_t kAirHu = -1000;

LabelledGrid NoLabels() {
  return {
      .structures = VoxelGrid<StructureSet>(kGrid), .covered = LabelGrid(kGrid, 1), .voxel_mm = 1};
}

void Fill(int first, int last, StructureSet set, LabelledGrid* labels) {
  for (int z = first; z <= last; ++z) {
    for (int y = first; y <= last; ++y) {
      for (int x = first; x <= last; ++x) labels->structures.At(x, y, z) |= set;
    }
  }
}

TEST(ClearByLabelsTest, AirwaysAndTubesBecomeAirInsideTheirBorder) {
  for (const Structure hollow : {Structure::kAirway, Structure::kTube}) {
    LabelledGrid labels = NoLabels();
    Fill(3, 8, SetOf(hollow), &labels);
    HuGrid ct(kGrid, kTissueHu);
    ct.At(6, 6, 6) = kBoneHu;
    const ClearedByLabels cleared = ClearByLabels(labels, {}, &ct);
    EXPECT_EQ(ct.At(4, 4, 4), kAirHu);
    EXPECT_EQ(ct.At(3, 5, 5), kTissueHu);  // the border: the CT decides
    EXPECT_EQ(ct.At(2, 5, 5), kTissueHu);
    // A tube may be dense; what is dense in an airway is bone.
    EXPECT_EQ(ct.At(6, 6, 6), hollow == Structure::kTube ? kAirHu : kBoneHu);
    EXPECT_EQ(cleared.hollow_mm3, hollow == Structure::kTube ? 64 : 63);
  }
}

TEST(ClearByLabelsTest, OutsideOfTheLabelledHeadBecomesAir) {
  LabelledGrid labels = NoLabels();
  Fill(2, 9, SetOf(Structure::kHead), &labels);
  labels.structures.At(6, 6, 6) = 0;  // a hole inside is not outside
  HuGrid ct(kGrid, kTissueHu);
  const ClearedByLabels cleared = ClearByLabels(labels, {}, &ct);
  EXPECT_FALSE(cleared.head_is_open);
  EXPECT_EQ(ct.At(0, 6, 6), kAirHu);
  EXPECT_EQ(ct.At(1, 6, 6), kTissueHu);
  EXPECT_EQ(ct.At(6, 6, 6), kTissueHu);
}

TEST(ClearByLabelsTest, AnOpenSkinShowsNoOutside) {
  LabelledGrid labels = NoLabels();
  for (int z = 0; z < kSize; ++z) {
    for (int x = 0; x < kSize; ++x) labels.structures.At(x, 1, z) = SetOf(Structure::kHead);
  }
  HuGrid ct(kGrid, kTissueHu);
  const ClearedByLabels cleared = ClearByLabels(labels, {}, &ct);
  EXPECT_TRUE(cleared.head_is_open);
  EXPECT_EQ(cleared.outside_mm3, 0);
  EXPECT_EQ(ct.values, HuGrid(kGrid, kTissueHu).values);
}

struct Head {
  HeadSegmentation head;
  BoneParts parts;
};

// All tissue; a bone of the image at x 0 to 1 (cranium) and x 10 to 11 (mandible).
Head HeadOfTwoBones() {
  Head result;
  result.head.hu = HuGrid(kGrid, kTissueHu);
  result.head.head = LabelGrid(kGrid, 1);
  result.head.bone = LabelGrid(kGrid);
  result.parts.labels = LabelGrid(kGrid);
  for (int z = 0; z < kSize; ++z) {
    for (int y = 0; y < kSize; ++y) {
      for (const int x : {0, 1, 10, 11}) {
        result.head.bone.At(x, y, z) = 1;
        result.parts.labels.At(x, y, z) = x < 6 ? kCranium : kMandible;
      }
    }
  }
  return result;
}

TEST(ApplyLabelsTest, LabelsDecideBeyondTheirBorderAndTheImageOnIt) {
  LabelledGrid labels = NoLabels();
  Fill(3, 8, SetOf(Structure::kLowerJaw), &labels);
  labels.structures.At(0, 0, 0) = SetOf(Structure::kLowerJaw);
  Head head = HeadOfTwoBones();
  head.head.head.At(6, 6, 6) = 0;  // air in the labelled bone: a cell of it
  ApplyLabels(labels, &head.head, &head.parts);
  EXPECT_EQ(head.parts.labels.At(5, 5, 5), kMandible);  // not dense, but labelled: marrow
  EXPECT_EQ(head.head.bone.At(5, 5, 5), 1);
  EXPECT_EQ(head.parts.labels.At(3, 5, 5), 0);
  EXPECT_EQ(head.head.bone.At(6, 6, 6), 0);
  EXPECT_EQ(head.parts.labels.At(0, 0, 0), kMandible);   // the image had another bone
  EXPECT_EQ(head.parts.labels.At(1, 0, 0), kCranium);    // without a label
  EXPECT_EQ(head.parts.labels.At(11, 6, 6), kMandible);  // and the skull is not labelled
  EXPECT_EQ(head.parts.separation, JawSeparation::kThreshold);
}

TEST(ApplyLabelsTest, WithAllOfTheLowerJawLabelledNothingElseIsLowerJaw) {
  LabelledGrid labels = NoLabels();
  Fill(3, 8, SetOf(Structure::kLowerJaw), &labels);
  labels.structures.At(0, 0, 0) = SetOf(Structure::kSkull);
  labels.structures.At(10, 5, 5) = SetOf(Structure::kLowerTeeth);
  Head head = HeadOfTwoBones();
  ApplyLabels(labels, &head.head, &head.parts);
  EXPECT_EQ(head.parts.labels.At(10, 5, 5), kMandible);
  EXPECT_EQ(head.parts.labels.At(11, 5, 5), kMandible);  // on the border of the tooth
  EXPECT_EQ(head.parts.labels.At(11, 0, 0), 0);
  EXPECT_EQ(head.head.bone.At(11, 0, 0), 0);
  EXPECT_EQ(head.parts.separation, JawSeparation::kLabels);
}

TEST(CompareLabelsTest, CountsVoxelsOnlyInLabelsOrOnlyInTheImage) {
  LabelledGrid labels = NoLabels();
  labels.structures.At(0, 0, 0) = SetOf(Structure::kLowerJaw);   // the image: cranium
  labels.structures.At(5, 5, 5) = SetOf(Structure::kLowerJaw);   // the image: tissue
  labels.structures.At(10, 5, 5) = SetOf(Structure::kLowerJaw);  // both
  const Head head = HeadOfTwoBones();
  const LabelAgreement agreement = CompareLabels(labels, head.head, head.parts);
  ASSERT_EQ(agreement.structures.size(), 1U);
  EXPECT_EQ(agreement.structures[0].labelled_mm3, 3);
  EXPECT_EQ(agreement.structures[0].own_mm3, 2 * kSize * kSize);
  EXPECT_DOUBLE_EQ(agreement.structures[0].dice, 2.0 / (3 + 2 * kSize * kSize));
  EXPECT_EQ(agreement.other_bone_mm3, 1);
  EXPECT_EQ(agreement.only_labels_mm3, 1);
  EXPECT_EQ(agreement.only_image_mm3, 2 * kSize * kSize - 1);
  EXPECT_DOUBLE_EQ(agreement.bone_in_labels, 1.0 / (2 * kSize * kSize));
}

TEST(LabelFitTest, FindsTheShiftOfALabelledBone) {
  LabelledGrid labels = NoLabels();
  Fill(2, 5, SetOf(Structure::kSkull), &labels);
  HuGrid ct(kGrid, kTissueHu);
  for (int z = 5; z <= 8; ++z) {
    for (int y = 2; y <= 5; ++y) {
      for (int x = 2; x <= 5; ++x) ct.At(x, y, z) = kBoneHu;
    }
  }
  const LabelFit fit = MeasureLabelFit(labels, ct, 250);
  EXPECT_DOUBLE_EQ(fit.on_bone, 0.25);
  EXPECT_DOUBLE_EQ(fit.best_on_bone, 1);
  EXPECT_EQ(fit.best_move_mm, Eigen::Vector3d(0, 0, 3));
  EXPECT_FALSE(CheckLabelFit(fit).ok());
  EXPECT_TRUE(CheckLabelFit(MeasureLabelFit(NoLabels(), ct, 250)).ok());  // only hollows
}

}  // namespace
}  // namespace tissueform::testing
