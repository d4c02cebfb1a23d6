// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/mouth_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/mesh/tet_topology.h"
#include "core/planning/json_values.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

const Colour kSeenColour{0.10, 0.45, 0.75};
const Colour kUnseenColour{0.90, 0.55, 0.10};

const Colour kSlidesColour{0.25, 0.60, 0.35};
const Colour kMeetsBoneColour{0.85, 0.25, 0.20};
const Colour kMeetsLipColour{0.25, 0.40, 0.85};

// From under the nose to the chin, so that the mouth fills the picture.
constexpr double kShownMm = 40;
constexpr double kLineRadiusMm = 0.6;
constexpr double kCornerRadiusMm = 1.6;
// The line was measured behind the skin that is drawn, which hair is a part of; it is drawn before
// what skin is that near to it.
constexpr double kNearMm = 1.5;
constexpr double kBeforeSkinMm = 0.5;

bool IsSure(MouthCornerReason reason) { return reason == MouthCornerReason::kNotchEnds; }

Json CornerJson(const FaceAxes& axes, const MouthLinePoint& point, MouthCornerReason reason) {
  return {{"at_mm", ToJson(axes.Place(point.at))},
          {"from_midline_mm", std::abs(point.at.left)},
          {"sure", IsSure(reason)}};
}

// The triangles that are wanted, with their vertices only: the camera fits all vertices.
template <typename Wanted>
SurfaceLayer Part(const Positions& positions, const TriangleIndices& triangles, Wanted wanted) {
  SurfaceLayer layer{.positions = positions, .triangles = triangles};
  std::vector<int32_t> place_of(static_cast<size_t>(positions.rows()), -1);
  int32_t num_vertices = 0;
  Eigen::Index kept = 0;
  for (const auto& row : triangles.rowwise()) {
    if (!wanted({row[0], row[1], row[2]})) continue;
    for (Eigen::Index corner = 0; corner < 3; ++corner) {
      int32_t& place = place_of[static_cast<size_t>(row[corner])];
      if (place < 0) {
        place = num_vertices++;
        layer.positions.row(place) = positions.row(row[corner]);
      }
      layer.triangles(kept, corner) = place;
    }
    ++kept;
  }
  layer.positions.conservativeResize(num_vertices, 3);
  layer.triangles.conservativeResize(kept, 3);
  return layer;
}

SurfaceLayer SkinAboutMouth(const SkinCoverage& coverage, const FaceAxes& axes,
                            const FaceCoordinates& middle) {
  SurfaceLayer layer =
      Part(coverage.positions, coverage.triangles, [&](const std::array<int32_t, 3>& corners) {
        const FaceCoordinates at = axes.Of(coverage.positions.row(corners[0]).transpose());
        return std::abs(at.left) <= kShownMm && std::abs(at.up - middle.up) <= kShownMm;
      });
  layer.edges = false;
  layer.smooth = true;
  return layer;
}

// A place for every point of the line, before the skin.
std::vector<Vector3d> PlacesBefore(const SurfaceLayer& skin, const FaceAxes& axes,
                                   const MouthLine& mouth) {
  std::vector<Vector3d> places;
  for (const MouthLinePoint& point : mouth.points) {
    FaceCoordinates before = point.at;
    for (const auto& row : skin.positions.rowwise()) {
      const FaceCoordinates at = axes.Of(row.transpose());
      const bool is_near = std::hypot(at.left - point.at.left, at.up - point.at.up) < kNearMm;
      if (is_near) before.front = std::max(before.front, at.front);
    }
    before.front += kBeforeSkinMm;
    places.push_back(axes.Place(before));
  }
  return places;
}

// Octahedra, all of one size and colour.
SurfaceLayer Markers(const std::vector<Vector3d>& places, double radius_mm, const Colour& colour) {
  static constexpr std::array<std::array<int, 3>, 8> kFaces = {
      {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
  const auto count = static_cast<Eigen::Index>(places.size());
  SurfaceLayer layer{.positions = Positions(6 * count, 3),
                     .triangles = TriangleIndices(8 * count, 3),
                     .colour = colour,
                     .edges = false};
  for (Eigen::Index m = 0; m < count; ++m) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Vector3d away = radius_mm * Vector3d::Unit(axis);
      const Vector3d& place = places[static_cast<size_t>(m)];
      layer.positions.row(6 * m + 2 * axis) = (place + away).transpose();
      layer.positions.row(6 * m + 2 * axis + 1) = (place - away).transpose();
    }
    for (Eigen::Index face = 0; face < 8; ++face) {
      for (Eigen::Index corner = 0; corner < 3; ++corner) {
        layer.triangles(8 * m + face, corner) = static_cast<TriangleIndices::Scalar>(
            6 * m + kFaces[static_cast<size_t>(face)][static_cast<size_t>(corner)]);
      }
    }
  }
  return layer;
}

// `places` are those of the line's points.
std::vector<SurfaceLayer> LineLayers(const std::vector<Vector3d>& places, const MouthLine& mouth) {
  std::vector<Vector3d> seen;
  std::vector<Vector3d> unseen;
  for (size_t i = 0; i < places.size(); ++i) {
    (mouth.points[i].seen() ? seen : unseen).push_back(places[i]);
  }
  const auto corner = [](const Vector3d& place, MouthCornerReason reason) {
    return Markers({place}, kCornerRadiusMm, IsSure(reason) ? kSeenColour : kUnseenColour);
  };
  return {Markers(seen, kLineRadiusMm, kSeenColour), Markers(unseen, kLineRadiusMm, kUnseenColour),
          corner(places.front(), mouth.right_corner), corner(places.back(), mouth.left_corner)};
}

struct RowCounts {
  int64_t sliding = 0;
  int64_t bone = 0;
  int64_t behind_air = 0;  // of `bone`
  int64_t lips = 0;
};
RowCounts CountRows(const std::vector<ContactRow>& rows) {
  RowCounts counts;
  for (const ContactRow& row : rows) {
    const bool is_bone = row.other == ContactRow::kBone;
    counts.sliding += row.bilateral ? 1 : 0;
    counts.bone += is_bone && !row.bilateral ? 1 : 0;
    counts.behind_air += is_bone && row.gap_mm > 0 ? 1 : 0;
    counts.lips += is_bone ? 0 : 1;
  }
  return counts;
}

// The triangles of the parted mesh's boundary all corners of which touch something in one way.
SurfaceLayer Touching(const PlanBuild& build, uint8_t bit, const Colour& colour) {
  SurfaceLayer layer = Part(build.mesh.mesh.positions(), BoundaryFacets(build.mesh.mesh),
                            [&](const std::array<int32_t, 3>& corners) {
                              return std::all_of(corners.begin(), corners.end(), [&](int32_t v) {
                                return (build.lips->contact[static_cast<size_t>(v)] & bit) != 0;
                              });
                            });
  layer.colour = colour;
  return layer;
}

}  // namespace

Json MouthJson(const absl::StatusOr<MouthLine>& mouth, const Landmarks& landmarks) {
  if (!mouth.ok()) {
    const std::string text =
        absl::StrCat("The mouth line was not found: ", mouth.status().message(), ".");
    return {{"found", false}, {"says", Json::array({text})}};
  }
  const FaceAxes axes(landmarks);
  Json points = Json::array();
  for (const MouthLinePoint& point : mouth->points) {
    points.push_back(Json(ToJson(axes.Place(point.at))));
  }
  return {{"found", true},
          {"says", DescribeMouthLine(*mouth)},
          {"sure", mouth->line_is_sure()},
          {"seen_share", mouth->seen_share},
          {"parted_share", mouth->parted_share},
          {"near_metal", mouth->near_metal},
          {"right_corner", CornerJson(axes, mouth->points.front(), mouth->right_corner)},
          {"left_corner", CornerJson(axes, mouth->points.back(), mouth->left_corner)},
          {"points_mm", points}};
}

std::vector<Scene> MouthScenes(const SkinCoverage& coverage, const Landmarks& landmarks,
                               const MouthLine& mouth) {
  const FaceAxes axes(landmarks);
  SurfaceLayer skin = SkinAboutMouth(coverage, axes, mouth.points[mouth.points.size() / 2].at);
  std::vector<SurfaceLayer> layers = LineLayers(PlacesBefore(skin, axes, mouth), mouth);
  layers.push_back(std::move(skin));
  const Vector3d origin = axes.Place({});
  const auto view = [&](double left, double front) -> View {
    return {.from = axes.Place({.left = left, .front = front}) - origin,
            .up = axes.Place({.up = 1}) - origin};
  };
  return {{.title = "from the front", .surfaces = layers, .view = view(0, 1)},
          {.title = "from the left, front", .surfaces = layers, .view = view(0.75, 0.66)}};
}

std::vector<LegendEntry> MouthLegend() {
  return {{"seen, and a corner that was found", kSeenColour},
          {"not seen, and a corner that is unsure", kUnseenColour}};
}

Json LipContactJson(const std::optional<PartedLips>& lips) {
  if (!lips) return nullptr;
  const RowCounts counts = CountRows(lips->rows);
  const std::string text = absl::StrFormat(
      "The lips part along this line. Within %g mm of it and of its corners tissue slides along "
      "its "
      "own jaw at %d places, may lift off the other jaw's teeth, or meet a jaw behind air, at %d, "
      "and the lips touch each other at %d.",
      lips->vestibule_mm, counts.sliding, counts.bone, counts.lips);
  return {{"says", Json::array({text})},
          {"vestibule_mm", lips->vestibule_mm},
          {"sliding_rows", counts.sliding},
          {"bone_rows", counts.bone},
          {"bone_rows_behind_air", counts.behind_air},
          {"lip_rows", counts.lips},
          {"doubled_vertices", lips->original_of_double.size()},
          {"moved_vertices", lips->num_moved},
          {"added_vertices", lips->num_added}};
}

std::vector<Scene> LipContactScenes(const PlanBuild& build) {
  const FaceAxes axes(build.landmarks);
  const Vector3d origin = axes.Place({});
  const auto view = [&](double left, double front, double up) -> View {
    return {.from = axes.Place({.left = left, .front = front, .up = up}) - origin,
            .up = axes.Place({.up = 1}) - origin};
  };
  const std::vector<SurfaceLayer> layers = {Touching(build, kSlides, kSlidesColour),
                                            Touching(build, kMeetsBone, kMeetsBoneColour),
                                            Touching(build, kMeetsOtherLip, kMeetsLipColour)};
  return {{.title = "from the front", .surfaces = layers, .view = view(0, 1, 0.2)},
          {.title = "from the left, front", .surfaces = layers, .view = view(0.75, 0.66, 0.3)}};
}

std::vector<LegendEntry> LipContactLegend() {
  return {{"slides on its own jaw", kSlidesColour},
          {"may lift off the other jaw, or meet a jaw behind air", kMeetsBoneColour},
          {"touches the other lip", kMeetsLipColour}};
}

}  // namespace tissueform
