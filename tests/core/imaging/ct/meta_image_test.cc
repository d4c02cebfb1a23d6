// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/meta_image.h"

#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/imaging/ct/ct_volume_reader.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::StatusIs;

// A ball of tissue in air, in voxels whose sizes and places no short number gives.
CtVolume Ball(const Eigen::Matrix3d& direction) {
  CtVolume volume;
  volume.size = {20, 16, 12};
  volume.spacing_mm = {0.48828125, 1.0 / 3, 0.6999999999999997};
  volume.origin_mm = {-123.4567890123456789, 1.0 / 7, -1e-9 / 3};
  volume.direction = direction;
  for (int k = 0; k < 12; ++k) {
    for (int j = 0; j < 16; ++j) {
      for (int i = 0; i < 20; ++i) {
        const bool inside = Eigen::Vector3d(i - 10, j - 8, k - 6).norm() < 5;
        volume.hu.push_back(static_cast<int16_t>(inside ? 40 + i - j * k : -1000 + i));
      }
    }
  }
  return volume;
}

TEST(MetaImageTest, GeometryAndValuesAreTheSameToTheBitWhenRead) {
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  Eigen::Matrix3d tilted = Eigen::Matrix3d::Identity();
  tilted.col(2) = Eigen::Vector3d(0, 0.3, 1).normalized();
  const fs::path path = fs::path(::testing::TempDir()) / "meta_image_test.mha";
  for (const Eigen::Matrix3d& direction :
       {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), turned, tilted}) {
    const CtVolume volume = Ball(direction);
    ASSERT_OK_AND_ASSIGN(const std::string bytes, MetaImageOf(volume));
    std::ofstream(path, std::ios::binary) << bytes;
    ASSERT_OK_AND_ASSIGN(const CtVolume read, ReadCtVolume(path.string()));
    EXPECT_EQ(read.size, volume.size);
    EXPECT_EQ(read.spacing_mm, volume.spacing_mm);
    EXPECT_EQ(read.origin_mm, volume.origin_mm);
    EXPECT_EQ(read.direction, volume.direction);
    EXPECT_EQ(read.hu, volume.hu);
  }
  fs::remove(path);
}

TEST(MetaImageTest, UnevenSlicesAreRefused) {
  CtVolume volume = Ball(Eigen::Matrix3d::Identity());
  for (int k = 0; k < 12; ++k) volume.slice_origins_mm.emplace_back(0, 0, k * k);
  EXPECT_THAT(MetaImageOf(volume).status(),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not evenly spaced")));
}

}  // namespace
}  // namespace tissueform
