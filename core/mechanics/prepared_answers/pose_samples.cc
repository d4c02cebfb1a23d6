// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/pose_samples.h"

#include <cmath>
#include <cstdint>
#include <random>

namespace tissueform {
namespace {

// The standard's distributions are not the same everywhere; its generators are.
class Numbers {
 public:
  double Between(double low, double high) {
    return low + (high - low) * static_cast<double>(generator_() >> 11) * 0x1p-53;
  }

  Eigen::Vector3d Direction() {
    for (;;) {
      const Eigen::Vector3d v(Between(-1, 1), Between(-1, 1), Between(-1, 1));
      const double length = v.norm();
      if (length > 0.1 && length <= 1) return v / length;
    }
  }

 private:
  std::mt19937_64 generator_{20261123};
};

}  // namespace

std::vector<std::vector<HandlePose>> SamplePoses(const std::vector<Eigen::Vector3d>& centroids,
                                                 const PoseRange& range, int count) {
  Numbers numbers;
  std::vector<std::vector<HandlePose>> samples(static_cast<size_t>(count));
  for (size_t s = 0; s < samples.size(); ++s) {
    const bool at_the_edge = s % 2 == 1;
    const auto size = [&] { return at_the_edge ? 1.0 : numbers.Between(0, 1); };
    for (const Eigen::Vector3d& centroid : centroids) {
      HandlePose& pose = samples[s].emplace_back();
      pose.rotation_vector = size() * range.rotation_rad * numbers.Direction();
      pose.pivot_mm = centroid + size() * range.pivot_offset_mm * numbers.Direction();
      pose.translation_mm = size() * range.translation_mm * numbers.Direction();
      const double change = size() * range.scale_change;
      pose.scale = 1 + (numbers.Between(-1, 1) < 0 ? -change : change);
    }
  }
  return samples;
}

std::vector<Eigen::Vector3d> HandleCentroids(const MeshPreparation& preparation) {
  std::vector<Eigen::Vector3d> centroids;
  for (const HandleRegion& handle : preparation.constraints().handles()) {
    centroids.emplace_back(
        preparation.mesh().positions()(handle.vertices, Eigen::all).colwise().mean());
  }
  return centroids;
}

}  // namespace tissueform
