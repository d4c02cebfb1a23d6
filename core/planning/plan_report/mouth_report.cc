// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/mouth_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/planning/json_values.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

const Colour kSeenColour{0.10, 0.45, 0.75};
const Colour kUnseenColour{0.90, 0.55, 0.10};

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

// The skin's triangles about the mouth, with their vertices only: the camera fits all vertices.
SurfaceLayer SkinAboutMouth(const SkinCoverage& coverage, const FaceAxes& axes,
                            const FaceCoordinates& middle) {
  SurfaceLayer layer{.positions = coverage.positions,
                     .triangles = coverage.triangles,
                     .edges = false,
                     .smooth = true};
  std::vector<int32_t> place_of(static_cast<size_t>(coverage.positions.rows()), -1);
  int32_t num_vertices = 0;
  Eigen::Index kept = 0;
  for (const auto& row : coverage.triangles.rowwise()) {
    const FaceCoordinates at = axes.Of(coverage.positions.row(row[0]).transpose());
    if (std::abs(at.left) > kShownMm || std::abs(at.up - middle.up) > kShownMm) continue;
    for (Eigen::Index corner = 0; corner < 3; ++corner) {
      int32_t& place = place_of[static_cast<size_t>(row[corner])];
      if (place < 0) {
        place = num_vertices++;
        layer.positions.row(place) = coverage.positions.row(row[corner]);
      }
      layer.triangles(kept, corner) = place;
    }
    ++kept;
  }
  layer.positions.conservativeResize(num_vertices, 3);
  layer.triangles.conservativeResize(kept, 3);
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

}  // namespace tissueform
