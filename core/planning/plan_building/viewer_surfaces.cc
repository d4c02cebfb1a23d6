// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/viewer_surfaces.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "absl/status/status.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/outer_skin.h"
#include "core/imaging/anatomy/surface_extraction.h"
#include "core/mesh/generation/surface_decimation.h"
#include "core/planning/plan_building/crown_finder.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

// Of the Gaussian that takes the terraces of the voxels off the surfaces: in voxels of the grid, of
// the CT that it was resampled from, and at most.
constexpr double kSmoothVoxels = 0.7;
constexpr double kSmoothCtVoxels = 0.6;
constexpr double kMaxSmoothMm = 2;
// So many HU above the threshold count as one voxel inside: what a scanner's blur makes of the edge
// of a bone.
constexpr double kBoneEdgeHu = 400;

TriangleMesh Pick(const TriangleMesh& surface, const std::vector<Index>& triangles) {
  std::vector<int32_t> number(static_cast<size_t>(surface.num_vertices()), -1);
  TriangleIndices picked(static_cast<Index>(triangles.size()), 3);
  std::vector<Index> from;
  for (size_t f = 0; f < triangles.size(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int32_t v = surface.triangles()(triangles[f], k);
      int32_t& n = number[static_cast<size_t>(v)];
      if (n < 0) {
        n = static_cast<int32_t>(from.size());
        from.push_back(v);
      }
      picked(static_cast<Index>(f), k) = n;
    }
  }
  return *TriangleMesh::Create(surface.positions()(from, Eigen::all), std::move(picked));
}

CaseSurface ToCaseSurface(const std::string& name, SurfaceKind kind, const std::string& handle,
                          const TriangleMesh& mesh) {
  return {.name = name,
          .kind = kind,
          .handle = handle,
          .positions = mesh.positions().cast<float>(),
          .triangles = mesh.triangles()};
}

// Splits a surface by the middles of its triangles; a part without triangles is left out.
template <typename Choose>
std::vector<std::optional<TriangleMesh>> Split(const TriangleMesh& surface, size_t parts,
                                               const Choose& choose) {
  std::vector<std::vector<Index>> triangles(parts);
  for (Index f = 0; f < surface.num_triangles(); ++f) {
    const Vector3d middle =
        surface.positions()(surface.triangles().row(f), Eigen::all).colwise().mean();
    triangles[choose(middle)].push_back(f);
  }
  std::vector<std::optional<TriangleMesh>> split(parts);
  for (size_t p = 0; p < parts; ++p) {
    if (!triangles[p].empty()) split[p] = Pick(surface, triangles[p]);
  }
  return split;
}

// Inner air counts as tissue: the outer skin is one closed surface, without sinuses and airway.
// Clamped, so that bone under thin skin does not draw the surface outward.
absl::StatusOr<TriangleMesh> SkinSurface(const HeadSegmentation& head, const LabelGrid& outside_air,
                                         double ct_voxel_mm) {
  constexpr float kAirHu = -1000;
  const auto level = static_cast<float>(head.options.tissue_above_hu);
  FloatGrid hu(head.hu.geometry);
  for (size_t i = 0; i < hu.values.size(); ++i) {
    const bool is_inner_air = head.hu.values[i] <= level && outside_air.values[i] == 0;
    hu.values[i] = is_inner_air ? 2 * level - kAirHu
                                : std::clamp(static_cast<float>(head.hu.values[i]), kAirHu,
                                             2 * level - kAirHu);
  }
  const double smooth_mm = std::max(kSmoothVoxels * hu.geometry.spacing_mm,
                                    std::min(kMaxSmoothMm, kSmoothCtVoxels * ct_voxel_mm));
  return ExtractSurface(GaussianSmooth(hu, smooth_mm),
                        {.level = level,
                         .clearance = 20,
                         .min_cavity_volume_mm3 = std::numeric_limits<double>::infinity()});
}

// Bone ends two voxels before the skin where the CT does, so that it does not show through.
void ClearBorder(LabelGrid* mask) {
  const auto& size = mask->geometry.size;
  size_t index = 0;
  for (int z = 0; z < size[2]; ++z) {
    for (int y = 0; y < size[1]; ++y) {
      for (int x = 0; x < size[0]; ++x, ++index) {
        if (x < 2 || y < 2 || z < 2 || x >= size[0] - 2 || y >= size[1] - 2 || z >= size[2] - 2) {
          mask->values[index] = 0;
        }
      }
    }
  }
}

// The CT's own surface where bone ends, which keeps teeth sharp, and a smooth one where a cut ends
// it: the lesser of both heights, in mm, the second moved out by half a voxel so that it does not
// come before the first where both are there.
absl::StatusOr<TriangleMesh> BoneSurface(
    const HeadSegmentation& head, const LabelGrid& bone, uint8_t label,
    double min_part_volume_mm3 = std::numeric_limits<double>::infinity()) {
  LabelGrid mask = MaskWhere(bone, [label](uint8_t value) { return value == label; });
  ClearBorder(&mask);
  const VoxelBox box = Grown(BoundingBox(mask), 3, mask.geometry);
  mask = Crop(mask, box);
  const HuGrid hu = Crop(head.hu, box);
  const double voxel_mm = mask.geometry.spacing_mm;
  FloatGrid height = GaussianSmooth(SignedDistanceMm(mask), kSmoothVoxels * voxel_mm);
  const double threshold = head.options.bone_above_hu;
  for (size_t i = 0; i < height.values.size(); ++i) {
    const double by_hu = std::clamp((hu.values[i] - threshold) / kBoneEdgeHu, -2.0, 2.0) * voxel_mm;
    const double by_label = height.values[i] + 0.5 * voxel_mm;
    // Inside the label marrow is bone, however dark it is.
    const double inside = height.values[i] > voxel_mm ? height.values[i] : by_hu;
    height.values[i] = static_cast<float>(std::min(inside, by_label));
  }
  return ExtractSurface(height, {.level = 0,
                                 .clearance = static_cast<float>(0.02 * voxel_mm),
                                 .min_cavity_volume_mm3 = std::numeric_limits<double>::infinity(),
                                 .min_part_volume_mm3 = min_part_volume_mm3});
}

// Whether the CT ends there: the surface runs up to half a voxel outside its last centres.
bool IsAtEnd(const Vector3d& place, const GridGeometry& geometry) {
  const Vector3d voxel = geometry.ToVoxels(place);
  for (int axis = 0; axis < 3; ++axis) {
    const double last = geometry.size[static_cast<size_t>(axis)] - 1;
    if (voxel[axis] < -0.02 || voxel[axis] > last + 0.02) return true;
  }
  return false;
}

// The skin, and what ends it where the CT does.
absl::StatusOr<std::vector<std::optional<TriangleMesh>>> SkinAndEnd(const HeadSegmentation& head,
                                                                    const LabelGrid& outside_air,
                                                                    double ct_voxel_mm) {
  TF_ASSIGN_OR_RETURN(const TriangleMesh fine, SkinSurface(head, outside_air, ct_voxel_mm));
  TF_ASSIGN_OR_RETURN(const TriangleMesh skin, DecimateSurface(fine, kSkinTriangles));
  auto split = Split(skin, 2, [&](const Vector3d& middle) -> size_t {
    return IsAtEnd(middle, head.hu.geometry) ? 1 : 0;
  });
  if (!split[0]) return absl::InvalidArgumentError("the CT does not show the head's skin");
  return split;
}

absl::Status AddSkin(const ViewerSources& sources, std::vector<CaseSurface>* surfaces) {
  TF_ASSIGN_OR_RETURN(const auto split,
                      SkinAndEnd(sources.head, sources.outside_air, sources.ct_voxel_mm));
  surfaces->push_back(ToCaseSurface("skin", SurfaceKind::kSkin, "", *split[0]));
  if (split[1]) {
    surfaces->push_back(ToCaseSurface("end of the CT", SurfaceKind::kSkin, "", *split[1]));
  }
  return absl::OkStatus();
}

void AddBone(const TriangleMesh& bone, const std::string& segment, const CrownFinder& crowns,
             std::vector<CaseSurface>* surfaces) {
  const auto split = Split(crowns.Cut(bone), 3, crowns);
  const std::string of = segment.empty() ? "" : " of " + segment;
  if (split[kPlainBone]) {
    surfaces->push_back(
        segment.empty()
            ? ToCaseSurface("bone", SurfaceKind::kBone, "", *split[kPlainBone])
            : ToCaseSurface(segment, SurfaceKind::kSegment, segment, *split[kPlainBone]));
  }
  if (split[kUpperTeeth]) {
    surfaces->push_back(
        ToCaseSurface("upper teeth" + of, SurfaceKind::kTeeth, segment, *split[kUpperTeeth]));
  }
  if (split[kLowerTeeth]) {
    surfaces->push_back(
        ToCaseSurface("lower teeth" + of, SurfaceKind::kTeeth, segment, *split[kLowerTeeth]));
  }
}

}  // namespace

absl::StatusOr<std::vector<CaseSurface>> MakeViewerSurfaces(const ViewerSources& sources) {
  std::vector<CaseSurface> surfaces;
  TF_RETURN_IF_ERROR(AddSkin(sources, &surfaces));
  std::vector<TriangleMesh> bones;
  int64_t triangles = 0;
  for (size_t label = kFixedBone; label < kFirstSegment + sources.segments.size(); ++label) {
    TF_ASSIGN_OR_RETURN(TriangleMesh bone,
                        BoneSurface(sources.head, sources.bone, static_cast<uint8_t>(label)));
    triangles += bone.num_triangles();
    bones.push_back(std::move(bone));
  }
  const double kept =
      std::min(1.0, static_cast<double>(kBoneTriangles) / static_cast<double>(triangles));
  for (size_t b = 0; b < bones.size(); ++b) {
    const auto wanted = static_cast<int64_t>(kept * static_cast<double>(bones[b].num_triangles()));
    TF_ASSIGN_OR_RETURN(const TriangleMesh bone, DecimateSurface(bones[b], wanted));
    const CrownFinder crowns(sources.landmarks, sources.parts, sources.bone,
                             static_cast<uint8_t>(kFixedBone + b));
    AddBone(bone, b == 0 ? "" : sources.segments[b - 1], crowns, &surfaces);
  }
  return surfaces;
}

absl::StatusOr<HeadShells> MakeHeadShells(const HeadSegmentation& head, double ct_voxel_mm) {
  TF_ASSIGN_OR_RETURN(const auto split, SkinAndEnd(head, OutsideAir(head), ct_voxel_mm));
  const LabelGrid bone = MaskWhere(head.bone, [](uint8_t value) { return value != 0; });
  // After an operation the jaws may touch the skull nowhere.
  TF_ASSIGN_OR_RETURN(const TriangleMesh fine,
                      BoneSurface(head, bone, 1, head.options.smallest_bone_mm3));
  TF_ASSIGN_OR_RETURN(TriangleMesh decimated, DecimateSurface(fine, kBoneTriangles));
  return HeadShells{.skin = *split[0], .bone = std::move(decimated)};
}

}  // namespace tissueform
