// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/online/demo_pictures.h"

#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"

#include "client/rendering/figure.h"
#include "core/base/status_macros.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

constexpr int kWidth = 1200;
constexpr int kHeight = 700;

// Axes of LPS: x to the patient's left, y to the back, z up.
struct NamedView {
  const char* file;
  const char* of_face;
  const char* of_anything;
  std::array<double, 3> from;
};
constexpr std::array<NamedView, 3> kViews = {
    {{"front.png", "from the front", "along y", {0, -1, 0}},
     {"left.png", "from the patient's left", "along x", {1, 0, 0}},
     {"three_quarter.png", "three-quarter view", "oblique", {0.75, -1, 0.1}}}};

SurfaceLayer Skin(const Positions& positions, const TriangleIndices& facets) {
  SurfaceLayer layer;
  layer.positions = positions;
  layer.triangles = facets;
  layer.edges = false;
  layer.smooth = true;
  return layer;
}

Scene SceneOf(const std::string& title, const NamedView& view, SurfaceLayer layer,
              const Positions& other) {
  Scene scene;
  scene.title = title;
  scene.view.from = Eigen::Vector3d(view.from.data());
  scene.surfaces = {std::move(layer)};
  scene.room_for = other;
  scene.room_for_legend = true;
  return scene;
}

// 1, 2 or 5 times a power of ten, so that the bar's labels are short.
double BarEnd(double largest_mm) {
  if (largest_mm <= 0) return 1;
  const double unit = std::pow(10.0, std::floor(std::log10(largest_mm)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (largest_mm <= factor * unit) return factor * unit;
  }
  return 10 * unit;
}

}  // namespace

std::vector<std::string> BeforeAndAfterPictures() {
  std::vector<std::string> names;
  names.reserve(std::size(kViews));
  for (const NamedView& view : kViews) names.emplace_back(view.file);
  return names;
}

absl::Status DrawBeforeAndAfter(const BeforeAndAfter& what, const std::string& folder) {
  const TriangleIndices facets = BoundaryFacets(what.mesh);
  const Positions& rest = what.mesh.positions();
  SurfaceLayer after = Skin(what.deformed, facets);
  after.vertex_values = (what.deformed - rest).rowwise().norm();
  const ColourBar bar{"movement of the skin [mm]", 0, BarEnd(after.vertex_values.maxCoeff())};
  for (const NamedView& view : kViews) {
    Figure figure(absl::StrCat(what.move, ", ", what.is_face ? view.of_face : view.of_anything),
                  kWidth);
    Scene predicted = SceneOf("after (predicted)", view, after, rest);
    predicted.colour_bar = bar;
    figure.AddRow(kHeight, {SceneOf("before", view, Skin(rest, facets), what.deformed),
                            std::move(predicted)});
    TF_RETURN_IF_ERROR(figure.WritePng(absl::StrCat(folder, "/", view.file)));
  }
  return absl::OkStatus();
}

}  // namespace tissueform
