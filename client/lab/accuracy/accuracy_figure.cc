// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/accuracy_figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"

#include "client/lab/accuracy/boundary_surface.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/comparison.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

constexpr int kPanelsInARow = 3;
constexpr int kPanelHeight = 380;
constexpr int kHeadPanelHeight = 470;
constexpr int kChartHeight = 460;
constexpr char kReference[] = "calculix_neo_hookean";
const Colour kPurple{0.45, 0.25, 0.60};

Eigen::VectorXd Distances(const Positions& a, const Positions& b) {
  return (a - b).rowwise().norm();
}

// Two digits, rounded up, so that the bar's labels are short.
double RoundUp(double value) {
  if (value <= 0) return 1;
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 1);
  return std::ceil(value / unit) * unit;
}

// What 95 % of `shown` keep within under the worst model but plain Poisson, which is far off where
// a handle turns: neither it nor a few vertices beside the handle must make all others blue.
double ColourRange(const std::vector<int32_t>& shown, const AccuracyResult& result,
                   const Positions& reference) {
  double high = 0;
  for (const ModelAnswer& model : result.models) {
    if (model.name == "plain_poisson") continue;
    const Eigen::VectorXd distances =
        Distances(model.positions(shown, Eigen::all), reference(shown, Eigen::all));
    high = std::max(high, SummarizeDistances({distances.begin(), distances.end()}).p95_mm);
  }
  return RoundUp(high);
}

Scene ModelScene(const BoundarySurface& skin, const ModelAnswer& model, const std::string& title,
                 const Positions& reference, const View& view) {
  const Eigen::VectorXd distances = Distances(model.positions, reference);
  SurfaceLayer layer;
  layer.positions = skin.Pick(model.positions);
  layer.triangles = skin.mesh.triangles();
  layer.vertex_values = distances(skin.vertices);
  layer.edges = false;
  Scene scene;
  scene.title = title;
  scene.surfaces = {std::move(layer)};
  scene.view = view;
  return scene;
}

// Most of a head's boundary is bone and far from the move: there the face counts.
std::string PanelTitle(const ModelVariant& variant, const ModelAnswer& model,
                       const Positions& reference, const SkinPlace* face) {
  const Eigen::VectorXd distances = Distances(model.positions, reference);
  if (face == nullptr) {
    return absl::StrFormat("%s: mean %.2g mm", variant.title, distances.mean());
  }
  const Eigen::VectorXd of_face = distances(face->vertices);
  return absl::StrFormat("%s: face %.2g mm", variant.title, of_face.mean());
}

struct CurveLook {
  Colour colour;
  CurveStyle style;
};

CurveLook LookOf(size_t index) {
  static const std::array<CurveLook, 5> kLooks = {{{kBlue, CurveStyle::kSolid},
                                                   {kBlue, CurveStyle::kDashed},
                                                   {kOrange, CurveStyle::kSolid},
                                                   {kOrange, CurveStyle::kDashed},
                                                   {kPurple, CurveStyle::kSolid}}};
  return kLooks[index % kLooks.size()];
}

Chart PoissonRatioChart(const std::vector<AccuracySweep>& sweeps, const std::string& model,
                        const std::string& title) {
  Chart chart;
  chart.title = title;
  chart.x_title = "Poisson's ratio";
  chart.y_title = "mean distance, % of the move";
  chart.y_high = 14;  // so that the panels have one scale
  for (const AccuracySweep& sweep : sweeps) {
    Curve curve;
    curve.name = sweep.name;
    curve.colour = LookOf(chart.curves.size()).colour;
    curve.style = LookOf(chart.curves.size()).style;
    for (const AccuracyResult& result : sweep.results) {
      const ModelAnswer* reference = result.Reference(kReference);
      if (reference == nullptr) continue;
      curve.x.push_back(result.poisson_ratio);
      curve.y.push_back(100 *
                        Distances(result.Model(model)->positions, reference->positions).mean() /
                        sweep.largest_displacement_mm);
    }
    chart.curves.push_back(std::move(curve));
  }
  return chart;
}

}  // namespace

absl::Status DrawAccuracyCase(const AccuracyCase& problem, const AccuracyResult& result,
                              const std::string& path) {
  const BoundarySurface skin = BoundaryOf(problem.mesh);
  const Positions& reference = result.Reference(kReference)->positions;
  const SkinPlace* face = FindPlace(problem.places, "face");
  const ColourBar bar{
      "mm to CalculiX neo-Hookean (darkest: or more)", 0,
      ColourRange(face != nullptr ? face->vertices : skin.vertices, result, reference)};
  Figure figure(absl::StrFormat("%s; Poisson's ratio %g", problem.title, result.poisson_ratio));
  for (const View& view : problem.views) {
    std::vector<Scene> row;
    for (const ModelVariant& variant : AllModelVariants()) {
      if (variant.is_prepared) continue;  // indistinguishable from the model itself at this range
      const ModelAnswer& model = *result.Model(variant.name);
      row.push_back(
          ModelScene(skin, model, PanelTitle(variant, model, reference, face), reference, view));
      row.back().colour_bar = bar;
      row.back().room_for_legend = true;
      // One legend a row, so that all rows have one scale.
      if (row.size() < kPanelsInARow) {
        row.back().colour_bar.title.clear();
      } else {
        figure.AddRow(face == nullptr ? kPanelHeight : kHeadPanelHeight, std::exchange(row, {}));
      }
    }
  }
  return figure.WritePng(path);
}

absl::Status DrawPoissonRatios(const std::vector<AccuracySweep>& sweeps, const std::string& path) {
  Figure figure("Models without Poisson's ratio against CalculiX neo-Hookean");
  figure.AddRow(
      kChartHeight,
      {PoissonRatioChart(sweeps, "gradient_field_propagated", "gradient field, propagated"),
       PoissonRatioChart(sweeps, "gradient_field_estimated", "gradient field, estimated"),
       PoissonRatioChart(sweeps, "arap", "ARAP")});
  return figure.WritePng(path);
}

}  // namespace tissueform
