// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/foreign_objects.h"

#include <cmath>
#include <functional>
#include <optional>
#include <random>

#include "gtest/gtest.h"

#include "core/imaging/anatomy/head_segmentation.h"
#include "tests/core/imaging/anatomy/head_phantom.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using testing::HeadPhantom;

constexpr int16_t kSoftHu = 40;
constexpr int16_t kAirHu = -1000;

// HU at a place, or nothing where the phantom stays as it is.
using Painter = std::function<std::optional<int16_t>(const Vector3d& place, int16_t hu)>;

HuGrid Painted(const Painter& painter) {
  HuGrid ct = HeadPhantom();
  ForEachVoxel(LabelGrid(ct.geometry, 1), [&](size_t index, const Vector3d& place) {
    ct.values[index] = painter(place, ct.values[index]).value_or(ct.values[index]);
  });
  return ct;
}

// A plate of 4 mm that stands off the left side of the head, as high and wide as an ear.
bool InEar(const Vector3d& p) {
  return p.x() > 60 && p.x() < 86 && std::abs(p.y() - 12) < 2 && std::abs(p.z() - 10) < 26;
}

// Before the chin and the neck, down to the lower border; the head is behind its middle line.
double FromTube(const Vector3d& p) { return std::hypot(p.x() - 12, p.y() + 87); }

std::optional<int16_t> Tube(const Vector3d& p, int16_t hu, int16_t wall_hu) {
  if (hu > -500 || p.z() > -20 || FromTube(p) > 5.5) return std::nullopt;
  return FromTube(p) > 4.2 ? wall_hu : kAirHu;
}

// Share of the soft voxels in a part of the CT that the segmentation keeps.
double ShareKept(const HuGrid& ct, const HeadSegmentation& head,
                 const std::function<bool(const Vector3d&)>& in_part) {
  int64_t tissue = 0;
  int64_t kept = 0;
  ForEachVoxel(LabelGrid(ct.geometry, 1), [&](size_t index, const Vector3d& place) {
    if (!in_part(place) || ct.values[index] <= -500) return;
    ++tissue;
    if (Interpolate(head.hu, place) > -500) ++kept;
  });
  return static_cast<double>(kept) / static_cast<double>(tissue);
}

TEST(AttachedObjectsTest, AnEarIsKept) {
  const HuGrid ct = Painted([](const Vector3d& p, int16_t hu) -> std::optional<int16_t> {
    if (hu < -500 && InEar(p)) return kSoftHu;
    return std::nullopt;
  });
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  EXPECT_EQ(ShareKept(ct, head, InEar), 1);
  EXPECT_TRUE(head.objects.empty());
}

TEST(AttachedObjectsTest, AnEarWithAHearingAidIsKept) {
  const HuGrid ct = Painted([](const Vector3d& p, int16_t hu) -> std::optional<int16_t> {
    if ((p - Vector3d(73, 12, 4)).norm() < 4) return 2000;
    if (hu < -500 && InEar(p)) return kSoftHu;
    return std::nullopt;
  });
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  EXPECT_EQ(ShareKept(ct, head, InEar), 1);
  EXPECT_TRUE(head.objects.empty());
}

TEST(AttachedObjectsTest, AFingerThatTouchesTheFaceIsKept) {
  const auto in_finger = [](const Vector3d& p) {
    return std::hypot(p.x() - 30, p.z() + 20) < 8 && p.y() < -60 && p.y() > -105;
  };
  const HuGrid ct = Painted([&](const Vector3d& p, int16_t hu) -> std::optional<int16_t> {
    if (hu < -500 && in_finger(p)) return kSoftHu;
    return std::nullopt;
  });
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  EXPECT_EQ(ShareKept(ct, head, in_finger), 1);
}

TEST(AttachedObjectsTest, RemovesATubeAndReportsItsPlaceOnTheSkin) {
  for (const int16_t wall_hu : {int16_t{300}, int16_t{60}}) {  // dense, or it leaves the CT
    SCOPED_TRACE(wall_hu);
    const HuGrid ct = Painted([&](const Vector3d& p, int16_t hu) { return Tube(p, hu, wall_hu); });
    ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
    ASSERT_FALSE(head.objects.empty());
    for (const AttachedObject& tube : head.objects) {
      // The chin parts it in two; what is left of a wall of one voxel may be as thin as a cord.
      EXPECT_NE(tube.kind, ObjectKind::kUnknown);
      ASSERT_FALSE(tube.contact_mm.empty());
      // The radius, two voxels beside it, and the next.
      for (const Vector3d& place : tube.contact_mm) EXPECT_LT(FromTube(place), 5.5 + 3 * 2.5);
    }
    const HuGrid bare = HeadPhantom();
    EXPECT_LT(ShareKept(ct, head,
                        [&](const Vector3d& p) {
                          return FromTube(p) < 5.5 && p.z() < -20 && Interpolate(bare, p) < -500;
                        }),
              0.02);
    EXPECT_GT(testing::DiceOverlap(
                  head.head, testing::AtPlaceOf(head.head.geometry, testing::HeadPhantomMask())),
              0.997);
  }
}

// A string of one voxel's width, up to 4 mm before the skin of the left cheek, from brow to chin.
bool InCord(const HuGrid& bare, const Vector3d& p) {
  return std::abs(p.x() - 30) < 1.3 && p.z() > -70 && p.z() < 30 && p.y() < 0 &&
         Interpolate(bare, p) < -500 && Interpolate(bare, p + Vector3d(0, 4, 0)) > -500;
}

TEST(AttachedObjectsTest, RemovesAndReportsACordThatLiesOnTheSkin) {
  const HuGrid bare = HeadPhantom();
  const HuGrid ct = Painted([&](const Vector3d& p, int16_t) -> std::optional<int16_t> {
    if (InCord(bare, p)) return int16_t{250};
    return std::nullopt;
  });
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  ASSERT_EQ(head.objects.size(), 1U);
  EXPECT_EQ(head.objects[0].kind, ObjectKind::kCord);
  EXPECT_NEAR(head.objects[0].middle_mm.x(), 30, 2);
  EXPECT_GT(head.objects[0].contact_mm.size(), 30U);
  for (const Vector3d& place : head.objects[0].contact_mm) EXPECT_NEAR(place.x(), 30, 3 * 2.5);
  // Of what stands out of the skin by more than a voxel.
  EXPECT_LT(ShareKept(ct, head,
                      [&](const Vector3d& p) {
                        return InCord(bare, p) && Interpolate(bare, p + Vector3d(0, 2, 0)) < -500;
                      }),
            0.02);
  EXPECT_GT(testing::DiceOverlap(
                head.head, testing::AtPlaceOf(head.head.geometry, testing::HeadPhantomMask())),
            0.997);
}

TEST(AttachedObjectsTest, AFoldOfSkinOfThatShapeIsKept) {
  const HuGrid bare = HeadPhantom();
  const HuGrid ct = Painted([&](const Vector3d& p, int16_t) -> std::optional<int16_t> {
    if (InCord(bare, p)) return kSoftHu;
    return std::nullopt;
  });
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  EXPECT_TRUE(head.objects.empty());
  EXPECT_EQ(ShareKept(ct, head, [&](const Vector3d& p) { return InCord(bare, p); }), 1);
}

// A blanket that touches an ear may take it, but not unseen.
TEST(AttachedObjectsTest, ReportsAnEarThatASheetRemoves) {
  const HuGrid ct = Painted([](const Vector3d& p, int16_t hu) -> std::optional<int16_t> {
    const bool sheet = std::abs(p.x() - 85) < 2 && p.y() > -60 && p.y() < 100 && p.z() > -100;
    if (hu < -500 && (InEar(p) || sheet)) return kSoftHu;
    return std::nullopt;
  });
  ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
  ASSERT_EQ(head.objects.size(), 1U);
  EXPECT_EQ(head.objects[0].kind, ObjectKind::kUnknown);
  EXPECT_LT(ShareKept(ct, head, InEar), 0.5);
  const double faces_mm2 =
      static_cast<double>(head.objects[0].contact_mm.size()) * head.objects[0].face_mm2;
  EXPECT_GT(faces_mm2, 52 * 4);  // where the ear hangs on the head
}

// A ball of skin and what is under it, 10 mm across or more, that hangs by a thread of 5 mm: no
// opening may take it. In random places of the phantom's face.
TEST(AttachedObjectsTest, APieceOfFaceThatHangsByAThreadIsKept) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> across(-40, 40);
  std::uniform_real_distribution<double> height(-60, 30);
  std::uniform_real_distribution<double> radius(5.5, 9);
  for (int k = 0; k < 8; ++k) {
    const double x = across(random);
    const double z = height(random);
    const double r = radius(random);
    const HuGrid bare = HeadPhantom();
    double y = -105;
    while (Interpolate(bare, {x, y, z}) < -500) y += 0.5;
    const Vector3d middle(x, y + 2, z);
    const auto in_piece = [&](const Vector3d& p) { return (p - middle).norm() < r; };
    const HuGrid ct = Painted([&](const Vector3d& p, int16_t) -> std::optional<int16_t> {
      const bool slit = (p - middle).norm() >= r && (p - middle).norm() < r + 3.5;
      const bool thread = std::hypot(p.x() - x, p.z() - z) < 2.5;
      if (slit && !thread) return kAirHu;
      return std::nullopt;
    });
    SCOPED_TRACE(::testing::Message() << x << " " << y << " " << z << " " << r);
    ASSERT_OK_AND_ASSIGN(const HeadSegmentation head, SegmentHead(ct));
    EXPECT_GT(ShareKept(ct, head, in_piece), 0.99);
  }
}

}  // namespace
}  // namespace tissueform
