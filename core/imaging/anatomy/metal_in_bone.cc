// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/metal_in_bone.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"

namespace tissueform {
namespace {

constexpr double kTallestStreakMm = 3.5;
constexpr double kBesideBoneMm = 2;
constexpr double kBesideMetalMm = 2;  // over and under it, where its blur ends
constexpr double kNearMetalMm = 5;
constexpr double kShared = 0.25;
constexpr int16_t kTissueHu = 60;

// The bone that stands: taller than any streak, or outside the heights from first to last slice.
LabelGrid StandingBone(const LabelGrid& bone, int first, int last) {
  const auto [size_x, size_y, size_z] = bone.geometry.size;
  LabelGrid standing = bone;
  for (int y = 0; y < size_y; ++y) {
    for (int x = 0; x < size_x; ++x) {
      for (int z = first; z <= last; ++z) {
        if (bone.At(x, y, z) == 0) continue;
        int low = z;
        int high = z;
        while (low > 0 && bone.At(x, y, low - 1) != 0) --low;
        while (high + 1 < size_z && bone.At(x, y, high + 1) != 0) ++high;
        const bool streak = (high - low + 1) * bone.geometry.spacing_mm <= kTallestStreakMm;
        for (int flat = z; streak && flat <= std::min(high, last); ++flat) {
          standing.At(x, y, flat) = 0;
        }
        z = high;
      }
    }
  }
  return standing;
}

LabelGrid WithoutMetal(LabelGrid labels, const LabelGrid& metal) {
  ForEachVoxel(metal, [&](size_t index, const Eigen::Vector3d&) { labels.values[index] = 0; });
  return labels;
}

// The part that each piece of metal belongs to; 0 where that is decided voxel by voxel.
std::vector<uint8_t> PartsOfPieces(const Components& pieces, const LabelGrid& grown) {
  std::vector<std::array<int64_t, 256>> counts(pieces.voxels.size() + 1);
  for (auto& count : counts) count.fill(0);
  for (size_t i = 0; i < grown.values.size(); ++i) {
    const auto piece = static_cast<size_t>(pieces.labels.values[i]);
    if (piece != 0 && grown.values[i] != 0) ++counts[piece][grown.values[i]];
  }
  std::vector<uint8_t> parts;
  for (auto& count : counts) {
    const auto most = std::max_element(count.begin(), count.end());
    const auto part = static_cast<uint8_t>(most - count.begin());
    const auto voxels = static_cast<double>(std::exchange(*most, 0));
    const auto second = static_cast<double>(*std::max_element(count.begin(), count.end()));
    parts.push_back(second < kShared * voxels ? part : uint8_t{0});
  }
  return parts;
}

void KeepToSides(const HeadSegmentation& head, const DentalCut& cut, LabelGrid* labels) {
  const FloatGrid from_metal = DistanceMm(head.metal);
  ForEachVoxel(*labels, [&](size_t index, const Eigen::Vector3d& place) {
    uint8_t& label = labels->values[index];
    if (label == kSpine || from_metal.values[index] > kNearMetalMm) return;
    if (!cut.box.Contains(place)) return;
    label = cut.plane.HeightMm(place) > 0 ? kCranium : kMandible;
  });
}

}  // namespace

double RemoveStreaks(HeadSegmentation* head) {
  const VoxelBox box = BoundingBox(head->metal);
  if (box.empty()) return 0;
  const GridGeometry& geometry = head->bone.geometry;
  const int beside = static_cast<int>(kBesideMetalMm / geometry.spacing_mm + 0.5);
  const int first = std::max(0, box.first[2] - beside);
  const int last = std::min(geometry.size[2] - 1, box.last[2] + beside);
  const FloatGrid from_standing = DistanceMm(StandingBone(head->bone, first, last));
  int64_t removed = 0;
  for (size_t i = 0; i < head->bone.values.size(); ++i) {
    if (head->bone.values[i] == 0 || head->metal.values[i] != 0) continue;
    if (from_standing.values[i] <= kBesideBoneMm) continue;
    head->bone.values[i] = 0;
    head->hu.values[i] = std::min(head->hu.values[i], kTissueHu);
    ++removed;
  }
  return static_cast<double>(removed) * VoxelVolumeMm3(geometry);
}

void AssignMetal(const HeadSegmentation& head, const DentalCut* cut, LabelGrid* labels) {
  if (CountVoxels(head.metal) == 0) return;
  // Over a flat height the flood comes from all sides at once: the nearest part gets the voxel.
  const LabelGrid grown = WatershedFromMarkers(VoxelGrid<int16_t>(labels->geometry, 0),
                                               WithoutMetal(*labels, head.metal), head.bone);
  const Components pieces = LabelComponents(head.metal, Neighbours::kCorners);
  const std::vector<uint8_t> part = PartsOfPieces(pieces, grown);
  for (size_t i = 0; i < grown.values.size(); ++i) {
    const auto piece = static_cast<size_t>(pieces.labels.values[i]);
    if (piece == 0 || grown.values[i] == 0) continue;
    const bool by_voxel = cut != nullptr || part[piece] == 0;
    labels->values[i] = by_voxel ? grown.values[i] : part[piece];
  }
  if (cut != nullptr) KeepToSides(head, *cut, labels);
}

}  // namespace tissueform
