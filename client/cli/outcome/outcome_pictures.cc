// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/outcome_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

constexpr int kRowHeightPx = 560;
// Twice what the field accepts.
constexpr double kScaleMm = 4;

// Axes of the head: x to the patient's left, y to the back, z up.
struct NamedView {
  const char* file;
  const char* title;
  std::array<double, 3> from;
};
constexpr std::array<NamedView, 2> kViews = {
    {{"front.png", "from the front", {0, -1, 0}}, {"left.png", "from the left", {1, -0.2, 0}}}};

SurfaceLayer Plain(const Positions& positions, const TriangleIndices& triangles) {
  SurfaceLayer layer;
  layer.positions = positions;
  layer.triangles = triangles;
  layer.edges = false;
  layer.smooth = true;
  return layer;
}

// Triangles that are compared, colored by the absolute distance, and the rest plain.
std::vector<SurfaceLayer> MapLayers(const ComparedFace& face, const Eigen::VectorXd& map) {
  std::vector<Eigen::Index> compared;
  std::vector<Eigen::Index> rest;
  for (Eigen::Index f = 0; f < face.triangles.rows(); ++f) {
    const auto t = face.triangles.row(f);
    const bool known = std::isfinite(map[t[0]] + map[t[1]] + map[t[2]]);
    (known ? compared : rest).push_back(f);
  }
  std::vector<SurfaceLayer> layers;
  if (!rest.empty()) layers.push_back(Plain(face.positions, face.triangles(rest, Eigen::all)));
  if (compared.empty()) return layers;
  SurfaceLayer colored = Plain(face.positions, face.triangles(compared, Eigen::all));
  colored.vertex_values = map.array().isFinite().select(map.array().abs(), 0.0);
  layers.push_back(std::move(colored));
  return layers;
}

class Panels {
 public:
  Panels(const HeadFrame& frame, const NamedView& view, const Positions& room) {
    scene_.view.from = frame.ToLps() * Eigen::Vector3d(view.from.data());
    scene_.view.up = frame.superior;
    scene_.room_for = room;
    scene_.room_for_legend = true;
  }

  Scene Face(const std::string& title, const Positions& positions,
             const TriangleIndices& triangles) const {
    Scene scene = scene_;
    scene.title = title;
    scene.surfaces = {Plain(positions, triangles)};
    return scene;
  }

  Scene Map(const std::string& title, const ComparedFace& face, const SignedSurface& real) const {
    Scene scene = scene_;
    scene.title = title;
    scene.surfaces = MapLayers(face, DistanceMap(face, real));
    scene.colour_bar = {"distance [mm]", 0, kScaleMm};
    return scene;
  }

 private:
  Scene scene_;
};

// Skin of the operated head beyond the pre-operative one's box would shrink all panels.
Positions RoomOf(const ComparedFace& before) {
  std::vector<Eigen::Index> face;
  for (size_t v = 0; v < before.regions.size(); ++v) {
    if (before.regions[v] != 0) face.push_back(static_cast<Eigen::Index>(v));
  }
  return before.positions(face, Eigen::all);
}

}  // namespace

absl::StatusOr<std::vector<std::string>> DrawOutcome(const Outcome& outcome, const HeadFrame& frame,
                                                     const std::string& folder) {
  const ComparedPrediction& first = outcome.predictions.front();
  const ComparedFace& before = outcome.predictions.back().face;
  const SignedSurface real(outcome.real_skin);
  std::vector<std::string> files;
  for (const NamedView& view : kViews) {
    const Panels panels(frame, view, RoomOf(before));
    const std::string how = absl::StrCat(first.model, ", ", first.movement, " movement");
    Figure figure(absl::StrCat("Prediction and operated face, ", view.title), 1600);
    figure.AddRow(
        kRowHeightPx,
        {panels.Face("before", before.positions, before.triangles),
         panels.Face(absl::StrCat("predicted: ", how), first.face.positions, first.face.triangles),
         panels.Face("real", real.mesh().positions(), real.mesh().triangles())});
    figure.AddRow(kRowHeightPx, {panels.Map("from predicted to real", first.face, real),
                                 panels.Map("from before to real", before, real)});
    TF_RETURN_IF_ERROR(figure.WritePng(absl::StrCat(folder, "/", view.file)));
    files.emplace_back(view.file);
  }
  return files;
}

}  // namespace tissueform
