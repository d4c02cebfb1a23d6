// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// CTs that are no whole head, or not one, or not the way up that they are said to be: made from the
// bundled head, each refused with a line that says what, where and what to do.

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/ct/ct_volume_reader.h"
#include "core/planning/plan_building/plan_builder.h"
#include "tests/core/planning/plan_building/coarse_recipe.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::StatusIs;
using testing::TestDataPath;

Recipe CoarseRecipe() {
  Recipe recipe = testing::CoarseRecipe();
  recipe.ct.axes = "RPI";
  return recipe;
}

// Numbers without a statement of their place, as they lie in the file: x to the right of the
// patient, y to the back, z to the feet.
struct RawVolume {
  std::array<int, 3> size;
  std::array<double, 3> spacing_mm;
  std::vector<int16_t> hu;

  int16_t& At(int x, int y, int z) {
    return hu[static_cast<size_t>(x + size[0] * (y + size[1] * z))];
  }
  int16_t At(int x, int y, int z) const {
    return hu[static_cast<size_t>(x + size[0] * (y + size[1] * z))];
  }
};

RawVolume Air(const std::array<int, 3>& size, const std::array<double, 3>& spacing_mm) {
  return {size, spacing_mm,
          std::vector<int16_t>(static_cast<size_t>(size[0] * size[1] * size[2]), -1000)};
}

RawVolume BundledHead() {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  const absl::StatusOr<CtVolume> head =
      ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options);
  EXPECT_TRUE(head.ok()) << head.status();
  return {head->size, {3.2, 3.2, 1.5}, head->hu};
}

template <typename Change>
void ForEach(RawVolume* volume, Change change) {
  for (int z = 0; z < volume->size[2]; ++z) {
    for (int y = 0; y < volume->size[1]; ++y) {
      for (int x = 0; x < volume->size[0]; ++x) {
        change(x * volume->spacing_mm[0], y * volume->spacing_mm[1], z * volume->spacing_mm[2],
               &volume->At(x, y, z));
      }
    }
  }
}

// Axis a of the result is axis from[a] of the volume, the other way round where turned[a].
RawVolume Turned(const RawVolume& volume, const std::array<size_t, 3>& from,
                 const std::array<bool, 3>& turned) {
  RawVolume result =
      Air({volume.size[from[0]], volume.size[from[1]], volume.size[from[2]]},
          {volume.spacing_mm[from[0]], volume.spacing_mm[from[1]], volume.spacing_mm[from[2]]});
  std::array<int, 3> to{};
  for (to[2] = 0; to[2] < result.size[2]; ++to[2]) {
    for (to[1] = 0; to[1] < result.size[1]; ++to[1]) {
      for (to[0] = 0; to[0] < result.size[0]; ++to[0]) {
        std::array<int, 3> at{};
        for (size_t axis = 0; axis < 3; ++axis) {
          at[from[axis]] = turned[axis] ? result.size[axis] - 1 - to[axis] : to[axis];
        }
        result.At(to[0], to[1], to[2]) = volume.At(at[0], at[1], at[2]);
      }
    }
  }
  return result;
}

absl::StatusOr<PlanBuild> Build(const RawVolume& volume, const Recipe& recipe = CoarseRecipe()) {
  const std::string path = absl::StrCat(::testing::TempDir(), "bad_head_", getpid(), ".nrrd");
  std::ofstream file(path, std::ios::binary);
  file << "NRRD0004\ntype: int16\ndimension: 3\nsizes: "
       << absl::StrCat(volume.size[0], " ", volume.size[1], " ", volume.size[2],
                       "\nspacings: ", volume.spacing_mm[0], " ", volume.spacing_mm[1], " ",
                       volume.spacing_mm[2])
       << "\nendian: little\nencoding: raw\n\n";
  file.write(reinterpret_cast<const char*>(volume.hu.data()),
             static_cast<std::streamsize>(volume.hu.size() * sizeof(int16_t)));
  file.close();
  absl::StatusOr<PlanBuild> build = BuildPlan(path, recipe);
  std::filesystem::remove(path);
  return build;
}

RawVolume WithoutJaw(RawVolume head) {
  ForEach(&head, [](double x, double y, double z, int16_t* hu) {
    const bool body = z > 96 && y < 100;
    const bool ramus = z > 40 && y > 80 && y < 112 && (x < 66 || x > 130);
    const bool molars = z > 84 && y > 66 && y < 112 && (x < 82 || x > 112);
    if ((body || ramus || molars) && *hu > 100) *hu = 40;
  });
  return head;
}

// The second head's first voxel at `at` of the first one's.
RawVolume TwoHeads(const RawVolume& head, const std::array<int, 3>& at) {
  RawVolume both =
      Air({head.size[0] + at[0], head.size[1] + at[1], head.size[2] + at[2]}, head.spacing_mm);
  for (int z = 0; z < head.size[2]; ++z) {
    for (int y = 0; y < head.size[1]; ++y) {
      for (int x = 0; x < head.size[0]; ++x) {
        for (int16_t* hu : {&both.At(x, y, z), &both.At(x + at[0], y + at[1], z + at[2])}) {
          *hu = std::max(*hu, head.At(x, y, z));
        }
      }
    }
  }
  return both;
}

TEST(BadHeadsTest, AHeadWithoutLowerJawIsRefused) {
  EXPECT_THAT(Build(WithoutJaw(BundledHead())),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("no lower jaw in view"), HasSubstr("under the chin"))));
}

// As for planning implants: the denture lies alone in the scanner.
TEST(BadHeadsTest, ADentureAloneIsRefused) {
  RawVolume teeth = BundledHead();
  ForEach(&teeth, [](double x, double y, double z, int16_t* hu) {
    const bool upper = x > 65 && x < 130 && y > 30 && y < 85 && z > 72 && z < 97;
    if (!upper || *hu < 600) *hu = -1000;
  });
  EXPECT_THAT(Build(teeth), StatusIs(absl::StatusCode::kInvalidArgument,
                                     AllOf(HasSubstr("has 21 cm3, a head more than 200"),
                                           HasSubstr("of a denture"))));
}

// Crowns and bridges of both jaws, molten into one: what is denser than bone among the teeth, and 3
// mm about it, 6 mm up and down.
RawVolume WithTeethHiddenByMetal(const RawVolume& head) {
  RawVolume hidden = head;
  for (int z = 48; z < 75; ++z) {
    for (int y = 11; y < 27; ++y) {
      for (int x = 20; x < 41; ++x) {
        int16_t densest = -1000;
        for (int i = -4; i <= 4; ++i) {
          for (int j = -1; j <= 1; ++j) {
            for (int k = -1; k <= 1; ++k) densest = std::max(densest, head.At(x + k, y + j, z + i));
          }
        }
        if (densest > 1300 && head.At(x, y, z) > -300) hidden.At(x, y, z) = 3071;
      }
    }
  }
  return hidden;
}

TEST(BadHeadsTest, TeethHiddenByMetalNeedAnOcclusalPlane) {
  const RawVolume hidden = WithTeethHiddenByMetal(BundledHead());
  EXPECT_THAT(Build(hidden), StatusIs(absl::StatusCode::kInvalidArgument,
                                      AllOf(HasSubstr("cm3) hides the teeth"),
                                            HasSubstr("give \"occlusal_plane\" in the recipe"))));
  Recipe recipe = CoarseRecipe();
  ASSERT_OK_AND_ASSIGN(const PlanBuild with_teeth, Build(BundledHead()));
  recipe.occlusal_plane = with_teeth.parts.occlusal_plane;
  ASSERT_OK_AND_ASSIGN(const PlanBuild build, Build(hidden, recipe));
  EXPECT_EQ(build.parts.separation, JawSeparation::kGivenCut);
  EXPECT_LT((build.landmarks.menton - with_teeth.landmarks.menton).norm(), 5);
  EXPECT_LT((build.landmarks.condyle.left - with_teeth.landmarks.condyle.left).norm(), 5);
}

TEST(BadHeadsTest, HalfAHeadIsRefusedWhereverItIsCut) {
  const auto is_half = StatusIs(
      absl::StatusCode::kInvalidArgument,
      AllOf(HasSubstr("only a part of the head is in view"), HasSubstr("both sides of the face")));
  for (const double cut_mm : {85.0, 97.0, 120.0}) {
    RawVolume half = BundledHead();
    ForEach(&half, [cut_mm](double x, double, double, int16_t* hu) {
      if (x > cut_mm) *hu = -1000;
    });
    EXPECT_THAT(Build(half), is_half) << cut_mm;
  }
  // The other half, and the volume ends with it.
  const RawVolume head = BundledHead();
  RawVolume cropped = Air({33, head.size[1], head.size[2]}, head.spacing_mm);
  for (int z = 0; z < head.size[2]; ++z) {
    for (int y = 0; y < head.size[1]; ++y) {
      for (int x = 0; x < 33; ++x) cropped.At(x, y, z) = head.At(x + 31, y, z);
    }
  }
  EXPECT_THAT(Build(cropped), is_half);
}

// What "RPI" calls the direction against the head's own axis `own` (1: its face, 2: its crown).
std::string Called(const std::array<size_t, 3>& from, const std::array<bool, 3>& turned,
                   size_t own) {
  static constexpr const char* kAgainst[3] = {"left", "front", "head"};
  static constexpr const char* kAlong[3] = {"right", "back", "feet"};
  const auto axis = static_cast<size_t>(std::find(from.begin(), from.end(), own) - from.begin());
  return turned[axis] ? kAlong[axis] : kAgainst[axis];
}

TEST(BadHeadsTest, AHeadTurnedByQuartersIsNamedAsItLies) {
  const RawVolume head = BundledHead();
  int turns = 0;
  std::array<size_t, 3> from = {0, 1, 2};
  do {
    const int swaps = (from[0] > from[1]) + (from[0] > from[2]) + (from[1] > from[2]);
    for (const bool x : {false, true}) {
      for (const bool y : {false, true}) {
        const std::array<bool, 3> turned = {x, y, (swaps + x + y) % 2 != 0};
        const bool upright = from[0] == 0 && from[1] == 1 && !x && !y;
        if (upright) continue;
        ++turns;
        const std::string how = absl::StrCat(
            "the head does not lie as the CT says: its crown points to what is called the ",
            Called(from, turned, 2), ", its face to what is called the ", Called(from, turned, 1),
            "; correct `axes`");
        EXPECT_THAT(Build(Turned(head, from, turned)),
                    StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(how)));
      }
    }
  } while (std::next_permutation(from.begin(), from.end()));
  EXPECT_EQ(turns, 23);
}

TEST(BadHeadsTest, TwoHeadsNextToOrAboveEachOtherAreRefused) {
  const RawVolume head = BundledHead();
  for (const std::array<int, 3>& at :
       {std::array<int, 3>{66, 0, 0}, std::array<int, 3>{52, 0, 0}, std::array<int, 3>{0, 0, 97},
        std::array<int, 3>{0, 0, 93}}) {
    EXPECT_THAT(Build(TwoHeads(head, at)),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         AllOf(HasSubstr("two heads"), HasSubstr("one patient"))))
        << at[0] << " " << at[2];
  }
}

}  // namespace
}  // namespace tissueform
