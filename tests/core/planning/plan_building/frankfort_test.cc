// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/frankfort.h"

#include <cmath>
#include <optional>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::kInvalid;
using testing::StatusIs;

// The bundled head, with what is found in it, once for all tests.
struct FoundHead {
  HeadSegmentation head;
  Landmarks landmarks;
  std::optional<FrankfortLandmarks> frankfort;
};

FoundHead FindAll() {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  const CtVolume volume =
      *ReadCtVolume(testing::TestDataPath("ct/headsq/headsq_quarter.nhdr"), options);
  HeadSegmentation head = *SegmentHead(*ResampleIsotropic(volume, 1.5));
  const BoneParts parts = *SeparateBoneParts(head, std::nullopt);
  const Landmarks landmarks = *FindLandmarks(head, parts);
  const auto frankfort = FindFrankfort(head.hu, head.options.bone_above_hu, landmarks);
  return {std::move(head), landmarks, frankfort};
}

class BundledHeadTest : public ::testing::Test {
 protected:
  static const FoundHead& Found() {
    static const FoundHead* const found = new FoundHead(FindAll());
    return *found;
  }
};

// As read off the CT by eye, on its slices.
TEST_F(BundledHeadTest, EarsAndEyesAreFoundWhereTheyAre) {
  ASSERT_TRUE(Found().frankfort.has_value());
  const FrankfortLandmarks& f = *Found().frankfort;
  EXPECT_LT((f.porion.left - Vector3d(-44, 113, -32)).norm(), 5);
  EXPECT_LT((f.porion.right - Vector3d(-150, 113, -34)).norm(), 5);
  EXPECT_LT((f.orbitale.left - Vector3d(-67, 38, -45)).norm(), 6);
  EXPECT_LT((f.orbitale.right - Vector3d(-125, 40, -44)).norm(), 6);
}

TEST_F(BundledHeadTest, TheFrameIsThePatients) {
  ASSERT_OK_AND_ASSIGN(const HeadFrame frame,
                       ChooseHeadFrame({Found().landmarks, Found().frankfort, {}, {}}));
  EXPECT_THAT(CheckHeadFrame(frame), IsOk());
  EXPECT_EQ(frame.source, "landmarks");
  const auto height = [&](const Vector3d& p) { return frame.superior.dot(p - frame.origin_mm); };
  const FrankfortLandmarks& f = *Found().frankfort;
  EXPECT_NEAR((height(f.porion.left) + height(f.porion.right)) / 2, 0, 1e-9);
  EXPECT_NEAR((height(f.orbitale.left) + height(f.orbitale.right)) / 2, 0, 1e-9);
  // This head lies with its chin 9 degrees up in the scanner.
  EXPECT_NEAR(std::asin(frame.posterior.z()) * (180 / M_PI), 9, 2);
  EXPECT_NEAR(Found().landmarks.midsagittal.HeightMm(frame.origin_mm), 0, 1e-9);
}

TEST_F(BundledHeadTest, FindsNoFrankfortPlaneThatIsOutOfView) {
  // Without what lies over the nose, as in a CT of the jaws.
  HuGrid low = Found().head.hu;
  for (int z = 0; z < low.geometry.size[2]; ++z) {
    if (low.geometry.Centre(0, 0, z).z() < -60) continue;
    for (int y = 0; y < low.geometry.size[1]; ++y) {
      for (int x = 0; x < low.geometry.size[0]; ++x) low.At(x, y, z) = -1000;
    }
  }
  EXPECT_FALSE(FindFrankfort(low, 250, Found().landmarks).has_value());
}

TEST_F(BundledHeadTest, ImplausibleLandmarksGiveNoFrankfortPlane) {
  Landmarks wrong = Found().landmarks;
  wrong.condyle.left.z() += 20;  // one ear is looked for far too high
  EXPECT_FALSE(FindFrankfort(Found().head.hu, 250, wrong).has_value());
  Landmarks turned = Found().landmarks;
  turned.upper_teeth.normal = Vector3d(0, 0.5, 0.5).normalized();
  EXPECT_FALSE(FindFrankfort(Found().head.hu, 250, turned).has_value());
}

class ChooseHeadFrameTest : public ::testing::Test {
 protected:
  ChooseHeadFrameTest() {
    landmarks_.midsagittal = {{1, 0, 0}, Vector3d(1, 0.05, 0).normalized()};
    landmarks_.condyle = {{51, 100, 20}, {-49, 100, 22}};
  }
  absl::StatusOr<HeadFrame> Choose(const std::optional<Plane>& midsagittal,
                                   const std::optional<Plane>& horizontal) const {
    return ChooseHeadFrame({landmarks_, std::nullopt, midsagittal, horizontal});
  }
  Landmarks landmarks_;
};

TEST_F(ChooseHeadFrameTest, WithoutHorizontalUpIsTheScannersAndLeftThePatients) {
  ASSERT_OK_AND_ASSIGN(const HeadFrame frame, Choose({}, {}));
  EXPECT_THAT(CheckHeadFrame(frame), IsOk());
  EXPECT_EQ(frame.source, "scanner");
  EXPECT_LT((frame.left - landmarks_.midsagittal.normal).norm(), 1e-12);
  EXPECT_LT((frame.superior - Vector3d::UnitZ()).norm(), 1e-12);
}

TEST_F(ChooseHeadFrameTest, GivenPlanesComeFirst) {
  const Plane horizontal{{0, 50, 10}, Vector3d(0, 0.2, 1).normalized()};
  ASSERT_OK_AND_ASSIGN(const HeadFrame frame, Choose({}, horizontal));
  EXPECT_THAT(CheckHeadFrame(frame), IsOk());
  EXPECT_EQ(frame.source, "recipe");
  EXPECT_NEAR(frame.superior.dot(landmarks_.midsagittal.normal), 0, 1e-12);
  EXPECT_GT(frame.superior.dot(horizontal.normal), 0.999);
  ASSERT_OK_AND_ASSIGN(const HeadFrame straight,
                       Choose(Plane{Vector3d::Zero(), Vector3d::UnitX()}, horizontal));
  EXPECT_EQ(straight.left, Vector3d::UnitX());
}

TEST_F(ChooseHeadFrameTest, RefusesImplausibleHeadPlanes) {
  const Plane up{Vector3d::Zero(), Vector3d::UnitZ()};
  const Plane left{Vector3d::Zero(), Vector3d::UnitX()};
  const Plane down{Vector3d::Zero(), -Vector3d::UnitZ()};
  const Plane right{Vector3d::Zero(), -Vector3d::UnitX()};
  EXPECT_THAT(Choose(left, up), IsOk());
  for (const auto& [midsagittal, horizontal] :
       {std::pair(left, down), std::pair(right, up), std::pair(up, up), std::pair(left, left)}) {
    EXPECT_THAT(Choose(midsagittal, horizontal), StatusIs(kInvalid, HasSubstr("/head_frame")));
  }
}

}  // namespace
}  // namespace tissueform
