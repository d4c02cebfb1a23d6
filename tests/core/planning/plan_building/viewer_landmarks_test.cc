// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/viewer_landmarks.h"

#include <map>
#include <string>

#include "gtest/gtest.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/osteotomy.h"

namespace tissueform {
namespace {

constexpr int kSide = 40;
constexpr int kLowestUpper = 20;  // the first layer of the upper jaw; the lower one is below it

struct Jaws {
  LabelGrid bone{GridGeometry{.size = {kSide, kSide, kSide}}};
  LabelGrid parts{bone.geometry};
};

// Two jaws in occlusion, of which the lower one is a segment.
Jaws InOcclusion() {
  Jaws jaws;
  for (int z = 10; z < 30; ++z) {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const bool is_lower = z < kLowestUpper;
        jaws.bone.At(x, y, z) = is_lower ? kFirstSegment : kFixedBone;
        jaws.parts.At(x, y, z) = is_lower ? kMandible : kCranium;
      }
    }
  }
  return jaws;
}

// The handle that each landmark follows; empty: none.
std::map<std::string, std::string> HandlesOf(const Landmarks& landmarks, const Jaws& jaws) {
  CaseSurface skin;
  skin.positions.setZero(1, 3);
  std::map<std::string, std::string> handles;
  for (const CaseLandmark& each :
       MakeViewerLandmarks(landmarks, std::nullopt, jaws.bone, jaws.parts, {"mandible"}, skin)) {
    handles[each.name] = each.handle;
  }
  return handles;
}

// The means of the voxels at a tooth's end: of teeth that bite, each may lie in the other jaw.
TEST(ViewerLandmarksTest, TeethThatBiteFollowTheirOwnJaw) {
  Landmarks landmarks;
  landmarks.upper_molar = {.left = {10, 10, kLowestUpper - 1.0}, .right = {30, 10, 21}};
  landmarks.lower_molar = {.left = {10, 10, kLowestUpper + 1.0}, .right = {30, 10, 18}};
  landmarks.upper_incisor = {20, 2, kLowestUpper - 1.0};
  landmarks.lower_incisor = {20, 2, kLowestUpper + 1.0};
  const std::map<std::string, std::string> handles = HandlesOf(landmarks, InOcclusion());
  for (const char* const name : {"upper_molar_left", "upper_molar_right", "upper_incisor"}) {
    EXPECT_EQ(handles.at(name), "") << name;
  }
  for (const char* const name : {"lower_molar_left", "lower_molar_right", "lower_incisor"}) {
    EXPECT_EQ(handles.at(name), "mandible") << name;
  }
}

TEST(ViewerLandmarksTest, FarFromItsJawALandmarkFollowsNothing) {
  Landmarks landmarks;
  landmarks.lower_incisor = {20, 2, kLowestUpper + 8.0};  // within the upper jaw
  landmarks.pogonion = {20, 2, 2};                        // 8 mm below the lower one
  landmarks.menton = {20, 2, 7};                          // 3 mm
  const std::map<std::string, std::string> handles = HandlesOf(landmarks, InOcclusion());
  EXPECT_EQ(handles.at("lower_incisor"), "");
  EXPECT_EQ(handles.at("pogonion"), "");
  EXPECT_EQ(handles.at("menton"), "mandible");
}

}  // namespace
}  // namespace tissueform
