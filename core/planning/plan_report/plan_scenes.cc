// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/plan_scenes.h"

#include <algorithm>
#include <array>
#include <functional>
#include <string>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/surface_extraction.h"
#include "core/planning/plan_report/cut_tets.h"
#include "core/planning/plan_report/label_colours.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

struct NamedView {
  std::string title;
  View view;
};

const Vector3d kFront(0, -1, 0);
const Vector3d kLeft(1, 0, 0);

std::vector<Scene> SeenFrom(const std::vector<NamedView>& views,
                            const std::vector<SurfaceLayer>& surfaces) {
  std::vector<Scene> scenes;
  scenes.reserve(views.size());
  for (const NamedView& view : views) {
    scenes.push_back({.title = view.title, .surfaces = surfaces, .view = view.view});
  }
  return scenes;
}

SurfaceLayer Plain(const TriangleMesh& mesh, const Colour& colour) {
  return {.positions = mesh.positions(),
          .triangles = mesh.triangles(),
          .colour = colour,
          .edges = false};
}

// The pieces of the bone that stays: the extraction gives one piece at a time.
absl::StatusOr<std::vector<SurfaceLayer>> FixedBone(const LabelGrid& bone) {
  constexpr double kSmallestPieceMm3 = 1000;
  const LabelGrid mask = MaskWhere(bone, [](uint8_t label) { return label == kFixedBone; });
  const double voxel_mm3 = VoxelVolumeMm3(bone.geometry);
  const Components pieces = LabelComponents(mask, Neighbours::kFaces,
                                            static_cast<int64_t>(kSmallestPieceMm3 / voxel_mm3));
  std::vector<SurfaceLayer> layers;
  for (size_t p = 0; p < pieces.voxels.size(); ++p) {
    LabelGrid piece = pieces.Mask(static_cast<int32_t>(p + 1));
    piece = Crop(piece, Grown(BoundingBox(piece), 3, piece.geometry));
    TF_ASSIGN_OR_RETURN(
        const TriangleMesh surface,
        ExtractSurface(GaussianSmooth(SignedDistanceMm(piece), 0.7 * bone.geometry.spacing_mm)));
    layers.push_back(Plain(surface, kFixedBoneColour));
  }
  return layers;
}

// The colour that two of the corners have, or that of the first.
Colour Majority(const Colour& first, const Colour& second, const Colour& third) {
  return second == third ? second : first;
}

// The triangles of the mesh's boundary that are wanted, in the colour of their corners.
SurfaceLayer Boundary(const PlanBuild& build,
                      const std::function<bool(const std::array<size_t, 3>& corners)>& is_wanted,
                      const std::function<Colour(size_t vertex)>& colour_of) {
  const TriangleMesh& surface = build.mesh.surface;
  SurfaceLayer layer{.positions = surface.positions(), .triangles = surface.triangles()};
  Eigen::Index kept = 0;
  for (const auto& row : surface.triangles().rowwise()) {
    const std::array<size_t, 3> corners = {static_cast<size_t>(row[0]), static_cast<size_t>(row[1]),
                                           static_cast<size_t>(row[2])};
    if (!is_wanted(corners)) continue;
    layer.triangles.row(kept++) = row;
    layer.triangle_colours.push_back(
        Majority(colour_of(corners[0]), colour_of(corners[1]), colour_of(corners[2])));
  }
  layer.triangles.conservativeResize(kept, 3);
  return layer;
}

Colour SkinVertexColour(const PlanningRegions& regions, size_t vertex) {
  if (!regions.on_skin[vertex]) return kCutColour;
  return SkinRegionColour(static_cast<SkinRegion>(regions.skin_region[vertex]));
}

Colour VertexColour(const PlanningRegions& regions, size_t vertex) {
  const uint8_t anatomy = regions.anatomy[vertex];
  if (anatomy >= kFirstSegment) return SegmentColour(static_cast<size_t>(anatomy - kFirstSegment));
  if (anatomy == kFixedBone) return regions.bone[vertex] != 0 ? kFixedBoneColour : kCutColour;
  return regions.bone[vertex] != 0 ? kFreedColour : kTissueColour;
}

std::vector<Colour> TissueColours(const PlanBuild& build) {
  std::vector<Colour> colours;
  for (const int32_t tissue : build.stiffness.tissue) {
    colours.push_back(TissueClassColour(static_cast<size_t>(tissue)));
  }
  return colours;
}

}  // namespace

absl::StatusOr<std::vector<Scene>> BoneScenes(const PlanBuild& build) {
  TF_ASSIGN_OR_RETURN(std::vector<SurfaceLayer> layers, FixedBone(build.bone));
  for (size_t s = 0; s < build.segments.size(); ++s) {
    layers.push_back(Plain(build.segments[s].surface, SegmentColour(s)));
  }
  return SeenFrom({{"from the front", {kFront}},
                   {"from the left", {kLeft}},
                   {"from below, right", {Vector3d(-0.75, -0.6, -0.5)}}},
                  layers);
}

std::vector<Scene> SkinScenes(const PlanBuild& build) {
  const auto all = [](const std::array<size_t, 3>& /*corners*/) { return true; };
  const auto colour = [&build](size_t vertex) { return SkinVertexColour(build.regions, vertex); };
  return SeenFrom({{"from the front", {kFront}},
                   {"from the left, front", {Vector3d(0.75, -0.75, 0.1)}},
                   {"from the left", {kLeft}}},
                  {Boundary(build, all, colour)});
}

std::vector<Scene> ConstraintScenes(const PlanBuild& build) {
  const PlanningRegions& regions = build.regions;
  const auto on_bone = [&regions](const std::array<size_t, 3>& corners) {
    return std::any_of(corners.begin(), corners.end(), [&regions](size_t vertex) {
      return regions.bone[vertex] != 0 || regions.anatomy[vertex] >= kFirstSegment;
    });
  };
  const auto colour = [&regions](size_t vertex) { return VertexColour(regions, vertex); };
  return SeenFrom({{"from the front", {kFront}},
                   {"from the left", {kLeft}},
                   {"from behind, right, below", {Vector3d(-0.6, 0.7, -0.45)}}},
                  {Boundary(build, on_bone, colour)});
}

std::vector<Scene> CutScenes(const PlanBuild& build) {
  const std::vector<Colour> colours = TissueColours(build);
  const TetMesh& mesh = build.mesh.mesh;
  const Landmarks& landmarks = build.landmarks;
  const Plane coronal{(landmarks.lower_molar.left + landmarks.lower_molar.right) / 2,
                      Vector3d::UnitY()};
  return {{.title = "left half, seen from the right",
           .surfaces = {CutTets(mesh, landmarks.midsagittal, colours)},
           .view = {-kLeft}},
          {.title = "behind the lower molars, from the front",
           .surfaces = {CutTets(mesh, coronal, colours)},
           .view = {kFront}}};
}

}  // namespace tissueform
