// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/metal/metal_detection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include <Eigen/LU>

#include "core/imaging/metal/slice_stack.h"

namespace tissueform {
namespace {

constexpr int16_t kDenseHu = 2500;    // metal blurred by half, or the densest enamel
constexpr int16_t kNoToothHu = 3000;  // enamel ends here
constexpr int16_t kSureHu = 3300;     // also where a sharp kernel has overshot
constexpr int kLeastSaturated = 4;    // one voxel has the highest value of any volume
constexpr double kStreakRatio = 2;
constexpr double kStreakReachMm = 15;
constexpr int kSlicesForUsual = 16;
constexpr double kSmallestMm3 = 0.5;    // a bracket has 10; less is noise or calcium
constexpr double kLargestHoleMm2 = 40;  // across a crown

using Voxels = std::vector<size_t>;

// Voxels above the threshold that hang together over faces, edges or corners, as lists of indices.
std::vector<Voxels> Clusters(const CtVolume& volume, double threshold_hu) {
  std::vector<Voxels> clusters;
  std::vector<bool> seen(volume.hu.size(), false);
  const auto& [ni, nj, nk] = volume.size;
  for (size_t start = 0; start < volume.hu.size(); ++start) {
    if (volume.hu[start] <= threshold_hu || seen[start]) continue;
    Voxels cluster = {start};
    seen[start] = true;
    for (size_t next = 0; next < cluster.size(); ++next) {
      const auto at = static_cast<int64_t>(cluster[next]);
      const int i = static_cast<int>(at % ni);
      const int j = static_cast<int>(at / ni % nj);
      const int k = static_cast<int>(at / ni / nj);
      for (int c = std::max(0, k - 1); c <= std::min(nk - 1, k + 1); ++c) {
        for (int b = std::max(0, j - 1); b <= std::min(nj - 1, j + 1); ++b) {
          for (int a = std::max(0, i - 1); a <= std::min(ni - 1, i + 1); ++a) {
            const auto index = static_cast<size_t>(a + int64_t{ni} * (b + int64_t{nj} * c));
            if (seen[index] || volume.hu[index] <= threshold_hu) continue;
            seen[index] = true;
            cluster.push_back(index);
          }
        }
      }
    }
    clusters.push_back(std::move(cluster));
  }
  return clusters;
}

// The middle one of the roughnesses of some slices, which few of them owe to metal.
double UsualRoughness(const CtVolume& volume, const SliceStack& stack) {
  std::vector<double> values;
  const int step = std::max(1, stack.slices / kSlicesForUsual);
  for (int slice = 0; slice < stack.slices; slice += step) {
    const double value =
        Roughness(volume, stack, slice, {0, 0}, {stack.shape.width - 1, stack.shape.height - 1});
    if (value >= 0) values.push_back(value);
  }
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<int64_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// In the cluster's middle slice, as far as streaks are strong.
double RoughnessAround(const CtVolume& volume, const SliceStack& stack, const Voxels& cluster) {
  std::array<int, 3> low = stack.Place(cluster.front());
  std::array<int, 3> high = low;
  for (const size_t index : cluster) {
    const std::array<int, 3> place = stack.Place(index);
    for (size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], place[axis]);
      high[axis] = std::max(high[axis], place[axis]);
    }
  }
  const auto dx = static_cast<int>(kStreakReachMm / stack.shape.pixel_width_mm);
  const auto dy = static_cast<int>(kStreakReachMm / stack.shape.pixel_height_mm);
  return Roughness(volume, stack, (low[0] + high[0]) / 2, {low[1] - dx, low[2] - dy},
                   {high[1] + dx, high[2] + dy});
}

class MetalJudge {
 public:
  MetalJudge(const CtVolume& volume, const SliceStack& stack) : volume_(volume), stack_(stack) {
    for (const int16_t hu : volume.hu) highest_ = std::max(highest_, hu);
  }

  bool IsMetal(const Voxels& cluster) {
    int16_t top = std::numeric_limits<int16_t>::min();
    int saturated = 0;
    for (const size_t index : cluster) {
      top = std::max(top, volume_.hu[index]);
      if (volume_.hu[index] == highest_) ++saturated;
    }
    if (top <= kNoToothHu) return false;
    if (top > kSureHu || saturated >= kLeastSaturated) return true;
    if (!usual_) usual_ = UsualRoughness(volume_, stack_);
    return RoughnessAround(volume_, stack_, cluster) >= kStreakRatio * *usual_;
  }

 private:
  const CtVolume& volume_;
  const SliceStack& stack_;
  int16_t highest_ = std::numeric_limits<int16_t>::min();
  std::optional<double> usual_;
};

MetalCluster Describe(const CtVolume& volume, const Voxels& voxels, double voxel_mm3) {
  MetalCluster cluster;
  cluster.volume_mm3 = static_cast<double>(voxels.size()) * voxel_mm3;
  cluster.low_z_mm = std::numeric_limits<double>::max();
  cluster.high_z_mm = std::numeric_limits<double>::lowest();
  cluster.top_hu = std::numeric_limits<int16_t>::min();
  for (const size_t index : voxels) {
    const auto at = static_cast<int64_t>(index);
    const Eigen::Vector3d place =
        volume.Place(static_cast<int>(at % volume.size[0]),
                     static_cast<int>(at / volume.size[0] % volume.size[1]),
                     static_cast<int>(at / volume.size[0] / volume.size[1]));
    cluster.centre_mm += place / static_cast<double>(voxels.size());
    cluster.low_z_mm = std::min(cluster.low_z_mm, place.z());
    cluster.high_z_mm = std::max(cluster.high_z_mm, place.z());
    cluster.top_hu = std::max(cluster.top_hu, volume.hu[index]);
  }
  return cluster;
}

}  // namespace

MetalFindings FindMetal(const CtVolume& volume, std::optional<double> threshold_hu) {
  const SliceStack stack(volume);
  MetalFindings findings;
  findings.threshold_hu = threshold_hu.value_or(kDenseHu);
  const double voxel_mm3 = std::abs(volume.StepsMm().determinant());
  MetalJudge judge(volume, stack);
  std::set<int> slices;
  for (const Voxels& cluster : Clusters(volume, findings.threshold_hu)) {
    if (static_cast<double>(cluster.size()) * voxel_mm3 < kSmallestMm3) continue;
    if (!threshold_hu && !judge.IsMetal(cluster)) continue;
    findings.mask.resize(volume.hu.size(), 0);
    for (const size_t index : cluster) {
      findings.mask[index] = 1;
      slices.insert(stack.Place(index)[0]);
    }
    findings.clusters.push_back(Describe(volume, cluster, voxel_mm3));
  }
  for (const int slice : slices) FillHoles(stack, slice, kLargestHoleMm2, &findings.mask);
  std::stable_sort(
      findings.clusters.begin(), findings.clusters.end(),
      [](const MetalCluster& a, const MetalCluster& b) { return a.volume_mm3 > b.volume_mm3; });
  return findings;
}

}  // namespace tissueform
