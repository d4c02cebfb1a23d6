// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/isotropic_resample.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "core/imaging/ct/ct_volume_reader.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tissueform::testing::StatusIs;

using Field = std::function<double(const Eigen::Vector3d&)>;

CtVolume Filled(const std::array<int, 3>& size, const Eigen::Vector3d& spacing_mm,
                const Eigen::Matrix3d& direction, const Field& field) {
  CtVolume volume;
  volume.size = size;
  volume.spacing_mm = spacing_mm;
  volume.origin_mm = {-7, 11, 40};
  volume.direction = direction;
  for (int k = 0; k < size[2]; ++k) {
    for (int j = 0; j < size[1]; ++j) {
      for (int i = 0; i < size[0]; ++i) {
        const Eigen::Vector3d place =
            volume.origin_mm + volume.StepsMm() * Eigen::Vector3d(i, j, k);
        volume.hu.push_back(static_cast<int16_t>(std::lround(field(place))));
      }
    }
  }
  return volume;
}

double Linear(const Eigen::Vector3d& p) { return 3 * p[0] - 5 * p[1] + 7 * p[2] + 100; }

// Upright with each axis along another, turned anyhow, and sheared as by a tilted gantry.
std::vector<Eigen::Matrix3d> Directions() {
  Eigen::Matrix3d permuted;
  permuted << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -3).normalized()).toRotationMatrix();
  Eigen::Matrix3d sheared = Eigen::Matrix3d::Identity();
  sheared.col(1) = Eigen::Vector3d(0, std::cos(0.3), -std::sin(0.3));
  return {Eigen::Matrix3d::Identity(),
          Eigen::Vector3d(-1, 1, -1).asDiagonal(),
          permuted,
          turned,
          sheared,
          turned * sheared};
}

// Whether a ball about a place lies between the outermost voxel centres.
bool IsWellInside(const CtVolume& volume, const Eigen::Vector3d& place, double radius_mm) {
  const Eigen::Matrix3d to_index = volume.StepsMm().inverse();
  const Eigen::Vector3d index = to_index * (place - volume.origin_mm);
  for (int axis = 0; axis < 3; ++axis) {
    const double margin = to_index.row(axis).norm() * radius_mm;
    if (index[axis] < margin || index[axis] > volume.size[static_cast<size_t>(axis)] - 1 - margin) {
      return false;
    }
  }
  return true;
}

TEST(IsotropicResampleTest, LinearFunctionOfPositionIsReproduced) {
  for (const Eigen::Matrix3d& direction : Directions()) {
    const CtVolume volume = Filled({20, 24, 16}, {0.9, 1.3, 2}, direction, Linear);
    for (const double spacing_mm : {0.8, 1.5, 3.1}) {
      ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(volume, spacing_mm));
      int inside = 0;
      for (int z = 0; z < grid.geometry.size[2]; ++z) {
        for (int y = 0; y < grid.geometry.size[1]; ++y) {
          for (int x = 0; x < grid.geometry.size[0]; ++x) {
            const Eigen::Vector3d place = grid.geometry.Centre(x, y, z);
            if (!IsWellInside(volume, place, spacing_mm)) continue;
            ++inside;
            // Half for the volume's rounding to whole HU, half for the grid's.
            ASSERT_NEAR(grid.At(x, y, z), Linear(place), 1.001);
          }
        }
      }
      EXPECT_GT(inside, 100);
    }
  }
}

// The mean of n samples along each axis of a voxel of the grid, each linear between centres, as the
// header says; air where none lies in the volume.
double MeanOfSamples(const CtVolume& volume, const Eigen::Vector3d& centre, double spacing_mm) {
  const Eigen::Matrix3d to_index = volume.StepsMm().inverse();
  std::vector<double> values;
  const Eigen::Vector3d steps = (to_index.cwiseAbs().transpose() * Eigen::Vector3d::Ones());
  const Eigen::Vector3d n = (steps * spacing_mm).array().ceil().max(1).min(8);
  for (int sample = 0; sample < static_cast<int>(n.prod()); ++sample) {
    const int across = static_cast<int>(n[0]);
    const int down = static_cast<int>(n[1]);
    const int along = sample / across / down;
    const int of_row = sample / across % down;
    const Eigen::Vector3d number(sample % across, of_row, along);
    const Eigen::Vector3d offset = (number.array() + 0.5) / n.array() - 0.5;
    const Eigen::Vector3d at = to_index * (centre + spacing_mm * offset - volume.origin_mm);
    double sum = 0;
    bool is_inside = true;
    for (int axis = 0; axis < 3; ++axis) {
      is_inside &= at[axis] >= -0.5 && at[axis] <= volume.size[static_cast<size_t>(axis)] - 0.5;
    }
    if (!is_inside) continue;
    for (int k = 0; k < volume.size[2]; ++k) {
      for (int j = 0; j < volume.size[1]; ++j) {
        for (int i = 0; i < volume.size[0]; ++i) {
          double weight = 1;
          for (int axis = 0; axis < 3; ++axis) {
            const double end = volume.size[static_cast<size_t>(axis)] - 1;
            const double off = std::clamp(at[axis], 0.0, end) - Eigen::Vector3d(i, j, k)[axis];
            weight *= std::max(0.0, 1 - std::abs(off));
          }
          sum += weight * volume.At(i, j, k);
        }
      }
    }
    values.push_back(sum);
  }
  if (values.empty()) return -1024;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

TEST(IsotropicResampleTest, UprightVolumesAreMeansOfTrilinearSamples) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> hu(-1024, 3000);
  const std::vector<Eigen::Matrix3d> directions = Directions();
  for (size_t d = 0; d < 3; ++d) {
    const CtVolume volume = Filled({5, 7, 4}, {0.9, 1.3, 2}, directions[d],
                                   [&](const Eigen::Vector3d&) { return hu(random); });
    for (const double spacing_mm : {0.7, 1.1, 2.9, 9.5}) {
      ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(volume, spacing_mm));
      for (int z = 0; z < grid.geometry.size[2]; ++z) {
        for (int y = 0; y < grid.geometry.size[1]; ++y) {
          for (int x = 0; x < grid.geometry.size[0]; ++x) {
            const double mean = MeanOfSamples(volume, grid.geometry.Centre(x, y, z), spacing_mm);
            ASSERT_NEAR(grid.At(x, y, z), mean, 0.5 + 1e-9)
                << "direction " << d << ", " << spacing_mm << " mm";
          }
        }
      }
    }
  }
}

// Heights of two thicknesses, as old scanners took heads; every third slice beside the others.
CtVolume Uneven(const Eigen::Matrix3d& direction, const Field& field) {
  CtVolume volume = Filled({20, 24, 10}, {0.9, 1.3, 4}, direction, field);
  const Eigen::Vector3d normal = direction.col(0).cross(direction.col(1));
  const std::array<double, 10> heights = {0, 1, 2, 2.4, 3.5, 5, 11, 14, 17.5, 20};
  volume.hu.clear();
  for (int k = 0; k < 10; ++k) {
    const Eigen::Vector3d beside = k % 3 == 0 ? Eigen::Vector3d(direction.col(0) * 1.7)
                                              : Eigen::Vector3d(Eigen::Vector3d::Zero());
    volume.slice_origins_mm.push_back(volume.origin_mm + beside +
                                      normal * heights.at(static_cast<size_t>(k)));
    for (int j = 0; j < 24; ++j) {
      for (int i = 0; i < 20; ++i) {
        volume.hu.push_back(static_cast<int16_t>(std::lround(field(volume.Place(i, j, k)))));
      }
    }
  }
  return volume;
}

TEST(IsotropicResampleTest, LinearFunctionIsReproducedBetweenUnevenSlices) {
  for (const Eigen::Matrix3d& direction : {Directions()[0], Directions()[3], Directions()[4]}) {
    const CtVolume volume = Uneven(direction, Linear);
    for (const double spacing_mm : {0.8, 1.5}) {
      ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(volume, spacing_mm));
      int inside = 0;
      for (int z = 0; z < grid.geometry.size[2]; ++z) {
        for (int y = 0; y < grid.geometry.size[1]; ++y) {
          for (int x = 0; x < grid.geometry.size[0]; ++x) {
            const Eigen::Vector3d place = grid.geometry.Centre(x, y, z);
            const Eigen::Vector3d from = place - volume.slice_origins_mm[1];
            const double height = direction.col(0).cross(direction.col(1)).dot(from) + 1;
            const double across = direction.col(0).dot(from);
            const double down = direction.col(1).dot(from);
            if (height < 1.5 || height > 18.5 || across < 3.5 || across > 15 || down < 1.5 ||
                down > 28) {
              continue;
            }
            ++inside;
            ASSERT_NEAR(grid.At(x, y, z), Linear(place), 1.001);
          }
        }
      }
      EXPECT_GT(inside, 500);
    }
  }
}

TEST(IsotropicResampleTest, UnevenSlicesAreExactWhereTheyLie) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> hu(-1024, 3000);
  CtVolume volume = Filled({9, 8, 4}, {1, 1, 1}, Eigen::Matrix3d::Identity(),
                           [&](const Eigen::Vector3d&) { return hu(random); });
  for (const double height : {0, 1, 4, 5}) {
    volume.slice_origins_mm.emplace_back(volume.origin_mm + Eigen::Vector3d(0, 0, height));
  }
  ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(volume, 1));
  ASSERT_THAT(grid.geometry.size, ElementsAre(9, 8, 6));
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 9; ++x) {
      EXPECT_EQ(grid.At(x, y, 0), volume.At(x, y, 0));
      EXPECT_EQ(grid.At(x, y, 1), volume.At(x, y, 1));
      EXPECT_EQ(grid.At(x, y, 4), volume.At(x, y, 2));
      EXPECT_EQ(grid.At(x, y, 5), volume.At(x, y, 3));
      EXPECT_NEAR(grid.At(x, y, 2), (2.0 * volume.At(x, y, 1) + volume.At(x, y, 2)) / 3, 0.51);
    }
  }
}

TEST(IsotropicResampleTest, GridOfTheSameVoxelsIsTheVolume) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> hu(-1024, 3000);
  const CtVolume volume = Filled({9, 8, 7}, {1.1, 1.1, 1.1}, Eigen::Matrix3d::Identity(),
                                 [&](const Eigen::Vector3d&) { return hu(random); });
  ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(volume, 1.1));
  EXPECT_THAT(grid.geometry.size, ElementsAre(9, 8, 7));
  EXPECT_TRUE(grid.geometry.origin_mm.isApprox(volume.origin_mm, 1e-12));
  EXPECT_EQ(grid.values, volume.hu);
}

TEST(IsotropicResampleTest, MarkKeepsItsPlaceWhateverTheFilesAxes) {
  const Eigen::Vector3d mark(4, 14, 35);
  for (const Eigen::Matrix3d& direction : Directions()) {
    CtVolume volume = Filled({40, 40, 40}, {1, 1, 1}, direction, Linear);
    const Eigen::Vector3d middle(19.5, 19.5, 19.5);
    volume.origin_mm = Eigen::Vector3d(0, 10, 40) - direction * middle;
    const Eigen::Vector3d index = volume.StepsMm().inverse() *
                                  (mark - volume.origin_mm);  // not the centre: left or right shows
    std::fill(volume.hu.begin(), volume.hu.end(), int16_t{-1000});
    const Eigen::Vector3i nearest = index.array().round().cast<int>();
    volume.hu[static_cast<size_t>(nearest[0] + 40 * (nearest[1] + 40 * nearest[2]))] = 3000;
    ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(volume, 0.5));
    const auto brightest = std::max_element(grid.values.begin(), grid.values.end());
    const auto at = static_cast<int>(brightest - grid.values.begin());
    const auto& size = grid.geometry.size;
    const Eigen::Vector3d found =
        grid.geometry.Centre(at % size[0], at / size[0] % size[1], at / size[0] / size[1]);
    EXPECT_LE((found - mark).norm(),
              1.4);  // half a voxel of the volume and half of the grid, diagonally
  }
}

TEST(IsotropicResampleTest, OutsideIsAir) {
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const CtVolume volume =
      Filled({20, 20, 20}, {1, 1, 1}, turned, [](const Eigen::Vector3d&) { return 50; });
  ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(volume, 1));
  EXPECT_EQ(grid.At(0, 0, 10), -1024);
  const auto air = std::count(grid.values.begin(), grid.values.end(), int16_t{-1024});
  const auto tissue = std::count(grid.values.begin(), grid.values.end(), int16_t{50});
  EXPECT_EQ(air + tissue, grid.geometry.num_voxels());
  EXPECT_NEAR(static_cast<double>(tissue), 8000, 200);
}

TEST(IsotropicResampleTest, CoarserVoxelsAreMeans) {
  const CtVolume stripes =
      Filled({24, 24, 24}, {0.5, 0.5, 0.5}, Eigen::Matrix3d::Identity(),
             [](const Eigen::Vector3d& p) { return std::lround(2 * p[0]) % 2 == 0 ? 0 : 1000; });
  ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(stripes, 2));
  EXPECT_THAT(grid.geometry.size, ElementsAre(6, 6, 6));
  EXPECT_THAT(grid.values, ::testing::Each(500));
}

TEST(IsotropicResampleTest, ThreadsDoNotChangeTheResult) {
  const CtVolume volume = Filled({30, 30, 30}, {0.9, 1.3, 2}, Directions().back(), Linear);
  ASSERT_OK_AND_ASSIGN(const HuGrid one, ResampleIsotropic(volume, 1.2, {.threads = 1}));
  ASSERT_OK_AND_ASSIGN(const HuGrid three, ResampleIsotropic(volume, 1.2, {.threads = 3}));
  EXPECT_EQ(one.values, three.values);
}

TEST(IsotropicResampleTest, MoreMemoryThanGivenIsRefusedBeforeItIsTaken) {
  const CtVolume volume = Filled({20, 20, 20}, {1, 1, 1}, Eigen::Matrix3d::Identity(), Linear);
  EXPECT_TRUE(ResampleIsotropic(volume, 1, {.max_bytes = 16000}).ok());
  EXPECT_THAT(ResampleIsotropic(volume, 1, {.max_bytes = 15999}),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("larger spacing")));
  for (const double spacing_mm : {0.0, -1.0, 0.01, 100.0, std::nan("")}) {
    EXPECT_THAT(ResampleIsotropic(volume, spacing_mm),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("spacing")));
  }
}

TEST(IsotropicResampleTest, BundledHeadStandsUprightAndLooksForward) {
  CtReadOptions options;
  options.axes = "RPI";
  options.hu_offset = -1024;
  ASSERT_OK_AND_ASSIGN(
      const CtVolume volume,
      ReadCtVolume(testing::TestDataPath("ct/headsq/headsq_quarter.nhdr"), options));
  ASSERT_OK_AND_ASSIGN(const HuGrid head, ResampleIsotropic(volume, 2));
  // Number of voxels over a threshold in a layer, and their mean y.
  const auto measure = [&head](int z, int threshold) {
    double count = 0;
    double sum_y = 0;
    for (int y = 0; y < head.geometry.size[1]; ++y) {
      for (int x = 0; x < head.geometry.size[0]; ++x) {
        if (head.At(x, y, z) < threshold) continue;
        ++count;
        sum_y += y;
      }
    }
    return std::pair(count, sum_y / count);
  };
  EXPECT_GT(measure(head.geometry.size[2] - 5, -200).first, 1.3 * measure(5, -200).first);
  // At this height the bone is mostly the lower jaw.
  constexpr int kJaw = 12;
  EXPECT_GT(measure(kJaw, 400).first, 100);
  EXPECT_LT(measure(kJaw, 400).second, measure(kJaw, -200).second - 5);
}

}  // namespace
}  // namespace tissueform
