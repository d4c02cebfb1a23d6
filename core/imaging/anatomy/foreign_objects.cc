// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/foreign_objects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "core/imaging/anatomy/itk_filters.h"

namespace tissueform {
namespace {

// Thin pieces are separated only up to this depth behind the outside air: deeper, the walls of
// nose, mouth and throat are connected with each other and with a tube that leads there. This
// is the thickness of tubes.
constexpr double kOutermostMm = 12;

// Skin and muscle have up to 100 HU; plastic of tubes 200 to 500, less where a voxel holds but a
// part of the wall. On the bundled head, whose pixels are twice as wide as the wall, 0.58 of a tube
// lie so near what is denser, of its ears and of the nose nothing.
constexpr int16_t kDenseHu = 150;
constexpr double kNearDenseMm = 6;
constexpr double kLeastDense = 0.4;

// The bundled head's tube has 38 mm2 of wall, its ears have 62 and 69. Without dense walls, which
// pixels of 2.5 mm blur away, the section must be the smaller.
constexpr double kTubeMm2 = 60;
constexpr double kFaintTubeMm2 = 45;
constexpr double kTubeMm = 40;
constexpr double kCordMm2 = 30;
constexpr double kCordMm = 60;
// One real cord of 4 mm, at voxels of 1 to 2 mm: ridges of 4 to 9 mm2, up to 180 mm long, of which
// a tenth or more is denser than this; skin and lips have less.
constexpr double kRidgeMm2 = 12;
constexpr int16_t kDenserThanSkinHu = 100;
constexpr double kLeastDenserThanSkin = 0.05;
constexpr double kLargestPartMm3 = 20e3;
constexpr double kLongestPartMm = 120;
constexpr double kMaxInHull = 0.5;

// Smaller than a grain of rice: specks and edges of the opening, which stay.
constexpr double kSmallestMm3 = 60;

std::vector<VoxelBox> BoxesOf(const Components& components) {
  const GridGeometry& grid = components.labels.geometry;
  std::vector<VoxelBox> boxes(components.voxels.size(), VoxelBox{.first = grid.size, .last = {}});
  size_t index = 0;
  for (int z = 0; z < grid.size[2]; ++z) {
    for (int y = 0; y < grid.size[1]; ++y) {
      for (int x = 0; x < grid.size[0]; ++x, ++index) {
        const int32_t label = components.labels.values[index];
        if (label == 0) continue;
        VoxelBox& box = boxes[static_cast<size_t>(label) - 1];
        const std::array<int, 3> voxel = {x, y, z};
        for (size_t axis = 0; axis < 3; ++axis) {
          box.first[axis] = std::min(box.first[axis], voxel[axis]);
          box.last[axis] = std::max(box.last[axis], voxel[axis]);
        }
      }
    }
  }
  return boxes;
}

double LengthMm(const VoxelBox& box, double spacing_mm) {
  double squared = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    squared += std::pow(spacing_mm * (box.last[axis] - box.first[axis] + 1), 2);
  }
  return std::sqrt(squared);
}

double ShareIn(const LabelGrid& piece, const LabelGrid& other) {
  return static_cast<double>(CountVoxels(Both(piece, other))) /
         static_cast<double>(CountVoxels(piece));
}

LabelGrid DenserThan(int16_t limit_hu, const LabelGrid& piece, const HuGrid& hu) {
  return Both(piece, MaskWhere(hu, [limit_hu](int16_t value) { return value > limit_hu; }));
}

double ShareNearDense(const LabelGrid& piece, const HuGrid& hu) {
  const LabelGrid dense = DenserThan(kDenseHu, piece, hu);
  if (CountVoxels(dense) == 0) return 0;
  return ShareIn(piece, MaskWhere(DistanceMm(dense), [](float mm) { return mm <= kNearDenseMm; }));
}

bool IsTube(const LabelGrid& piece, const VoxelBox& box, double section_mm2,
            const ThinPieces& pieces) {
  if (section_mm2 >= kTubeMm2) return false;
  const bool leaves = box.first[2] == 0 || box.last[2] + 1 == pieces.hu.geometry.size[2];
  if (leaves && section_mm2 < kFaintTubeMm2) return true;
  return ShareNearDense(piece, Crop(pieces.hu, box)) >= kLeastDense;
}

// Nothing for a part of the head.
std::optional<ObjectKind> KindOf(const LabelGrid& piece, const VoxelBox& box,
                                 const ThinPieces& pieces) {
  const double length_mm = LengthMm(box, piece.geometry.spacing_mm);
  const double volume_mm3 = VolumeMm3(piece);
  const double section_mm2 = volume_mm3 / length_mm;
  const auto margin_mm = static_cast<float>(piece.geometry.spacing_mm);
  const LabelGrid hull =
      MaskWhere(Crop(pieces.beyond_hull, box), [=](float mm) { return mm <= margin_mm; });
  if (ShareIn(piece, hull) < kMaxInHull) {
    if (length_mm >= kCordMm && section_mm2 < kCordMm2) return ObjectKind::kCord;
    if (length_mm >= kTubeMm && IsTube(piece, box, section_mm2, pieces)) return ObjectKind::kTube;
  }
  if (volume_mm3 > kLargestPartMm3 || length_mm > kLongestPartMm) return ObjectKind::kUnknown;
  return std::nullopt;
}

// The ridges on the thick part, and what stands out of it.
LabelGrid RidgesOf(const ThinPieces& pieces, const FloatGrid& to_outside) {
  LabelGrid ridges(pieces.tissue.geometry);
  for (size_t i = 0; i < ridges.values.size(); ++i) {
    const bool stands_out =
        pieces.to_core.values[i] > pieces.radius_mm && pieces.beyond_hull.values[i] > 0;
    const bool is_outermost = to_outside.values[i] < kOutermostMm;
    ridges.values[i] = pieces.tissue.values[i] != 0 && stands_out && is_outermost ? 1 : 0;
  }
  return ridges;
}

std::optional<ObjectKind> KindOfRidge(const LabelGrid& ridge, const VoxelBox& box,
                                      const ThinPieces& pieces) {
  const double length_mm = LengthMm(box, ridge.geometry.spacing_mm);
  if (length_mm < kCordMm || VolumeMm3(ridge) >= kRidgeMm2 * length_mm) return std::nullopt;
  const LabelGrid dense = DenserThan(kDenserThanSkinHu, ridge, Crop(pieces.hu, box));
  if (ShareIn(ridge, dense) < kLeastDenserThanSkin) return std::nullopt;
  return ObjectKind::kCord;
}

LabelGrid PieceIn(const Components& components, int32_t label, const VoxelBox& box) {
  return MaskWhere(Crop(components.labels, box), [label](int32_t value) { return value == label; });
}

Eigen::Vector3d MiddleOf(const LabelGrid& piece) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int64_t voxels = 0;
  ForEachVoxel(piece, [&](size_t /*index*/, const Eigen::Vector3d& place) {
    sum += place;
    ++voxels;
  });
  return sum / static_cast<double>(voxels);
}

// The layer of the wall that the opening's margin of a voxel has left beside objects.
void TakeStumps(const ThinPieces& pieces, LabelGrid* removed) {
  const double near_mm = 2 * removed->geometry.spacing_mm;
  const FloatGrid to_removed = DistanceMm(*removed);
  for (size_t i = 0; i < removed->values.size(); ++i) {
    if (pieces.tissue.values[i] != 0 && pieces.to_core.values[i] > pieces.radius_mm &&
        to_removed.values[i] <= near_mm) {
      removed->values[i] = 1;
    }
  }
}

// What was found so far.
struct FoundObjects {
  LabelGrid removed;
  std::vector<AttachedObject> objects;
  std::vector<VoxelBox> boxes;
};

// Adds the connected parts of a mask that are objects.
template <typename Kind>
void AddObjects(const LabelGrid& mask, const Kind& kind_of, FoundObjects* found) {
  const auto smallest = std::ceil(kSmallestMm3 / VoxelVolumeMm3(mask.geometry));
  const Components components =
      LabelComponents(mask, Neighbours::kCorners, static_cast<int64_t>(smallest));
  const std::vector<VoxelBox> boxes = BoxesOf(components);
  for (size_t k = 0; k < boxes.size(); ++k) {
    const auto label = static_cast<int32_t>(k + 1);
    const LabelGrid piece = PieceIn(components, label, boxes[k]);
    const std::optional<ObjectKind> kind = kind_of(piece, boxes[k]);
    if (!kind) continue;
    found->objects.push_back({.kind = *kind,
                              .volume_mm3 = VolumeMm3(piece),
                              .middle_mm = MiddleOf(piece),
                              .contact_mm = {}});
    found->boxes.push_back(boxes[k]);
    for (size_t i = 0; i < found->removed.values.size(); ++i) {
      if (components.labels.values[i] == label) found->removed.values[i] = 1;
    }
  }
}

// The faces of the head's voxels that are on what was removed, each to the nearest object.
void AddContacts(const LabelGrid& head, const LabelGrid& removed,
                 const std::vector<VoxelBox>& boxes, std::vector<AttachedObject>* objects) {
  constexpr std::array<std::array<int, 3>, 6> kFaces = {
      {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};
  for (size_t k = 0; k < boxes.size(); ++k) {
    AttachedObject& object = (*objects)[k];
    object.face_mm2 = head.geometry.spacing_mm * head.geometry.spacing_mm;
    const VoxelBox box = Grown(boxes[k], 3, head.geometry);
    for (int z = box.first[2]; z <= box.last[2]; ++z) {
      for (int y = box.first[1]; y <= box.last[1]; ++y) {
        for (int x = box.first[0]; x <= box.last[0]; ++x) {
          if (removed.At(x, y, z) == 0) continue;
          for (const auto& [dx, dy, dz] : kFaces) {
            const bool in_grid = head.geometry.Contains(x + dx, y + dy, z + dz);
            if (!in_grid || head.At(x + dx, y + dy, z + dz) == 0) continue;
            object.contact_mm.push_back(head.geometry.Centre(x + dx, y + dy, z + dz));
          }
        }
      }
    }
  }
}

}  // namespace

CleanedHead PartObjects(const ThinPieces& pieces) {
  const LabelGrid& tissue = pieces.tissue;
  const FloatGrid to_outside = DistanceMm(pieces.outside);
  const auto margin_mm = static_cast<float>(tissue.geometry.spacing_mm);
  LabelGrid thin(tissue.geometry);
  CleanedHead result{.head = pieces.thick, .objects = {}};
  for (size_t i = 0; i < tissue.values.size(); ++i) {
    if (tissue.values[i] == 0 || pieces.thick.values[i] != 0) continue;
    if (to_outside.values[i] < kOutermostMm) thin.values[i] = 1;
    const bool inner = thin.values[i] == 0 && pieces.beyond_hull.values[i] <= margin_mm;
    result.head.values[i] = thin.values[i] != 0 || inner ? 1 : 0;
  }
  FoundObjects found{.removed = LabelGrid(tissue.geometry), .objects = {}, .boxes = {}};
  AddObjects(
      thin, [&](const LabelGrid& piece, const VoxelBox& box) { return KindOf(piece, box, pieces); },
      &found);
  LabelGrid ridges = RidgesOf(pieces, to_outside);
  for (size_t i = 0; i < ridges.values.size(); ++i) {
    if (found.removed.values[i] != 0) ridges.values[i] = 0;
  }
  AddObjects(
      ridges,
      [&](const LabelGrid& ridge, const VoxelBox& box) { return KindOfRidge(ridge, box, pieces); },
      &found);
  if (!found.objects.empty()) TakeStumps(pieces, &found.removed);
  for (size_t i = 0; i < found.removed.values.size(); ++i) {
    if (found.removed.values[i] != 0) result.head.values[i] = 0;
  }
  result.head = LargestComponent(result.head, Neighbours::kFaces);
  result.objects = std::move(found.objects);
  AddContacts(result.head, found.removed, found.boxes, &result.objects);
  std::stable_sort(
      result.objects.begin(), result.objects.end(),
      [](const AttachedObject& a, const AttachedObject& b) { return a.volume_mm3 > b.volume_mm3; });
  std::erase_if(result.objects, [](const AttachedObject& o) { return o.contact_mm.empty(); });
  return result;
}

}  // namespace tissueform
