// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/blend_experiment.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "client/lab/accuracy/boundary_surface.h"
#include "core/base/csv_table.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mesh/bar_mesh.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

constexpr double kTranslationMm = 30;
const std::set<int> kShownSteps = {1, 6, 10, 20};

// A scheme run twice: as far as the figure shows it and until nothing changes any more.
struct NamedScheme {
  std::string name;
  IterationScheme scheme;
  Colour colour;
  CurveStyle style;
  TranslationResult result;
};

std::vector<NamedScheme> Schemes() {
  const IterationScheme linear{BlendMap::kLinear, 0, 60, 1e-6};
  const IterationScheme cosine{BlendMap::kCosine, 0, 60, 1e-6};
  IterationScheme fast_linear = linear;
  IterationScheme fast_cosine = cosine;
  fast_linear.acceleration_depth = 5;
  fast_cosine.acceleration_depth = 5;
  return {{"linear", linear, kOrange, CurveStyle::kSolid, {}},
          {"cosine", cosine, kBlue, CurveStyle::kSolid, {}},
          {"linear, Anderson", fast_linear, kOrange, CurveStyle::kDashed, {}},
          {"cosine, Anderson", fast_cosine, kBlue, CurveStyle::kDashed, {}}};
}

// The first update whose change is at most `limit_mm`, "-" if no update is.
std::string UpdatesTo(const std::vector<double>& changes_mm, double limit_mm) {
  const auto found = std::find_if(changes_mm.begin(), changes_mm.end(),
                                  [=](double change) { return change <= limit_mm; });
  return found == changes_mm.end() ? "-" : absl::StrCat(found - changes_mm.begin() + 1);
}

CsvTable Summary(const TetMesh& bar, const std::vector<NamedScheme>& schemes) {
  CsvTable table({"case", "updates_to_1e-2_of_translation", "updates_to_1e-3_of_translation",
                  "updates_to_1e-4_of_translation", "distance_after_10_updates_mm", "volume_ratio",
                  "inverted_tets", "source_says"});
  for (const NamedScheme& scheme : schemes) {
    const TranslationResult& result = scheme.result;
    const DeformationQuality quality = MeasureDeformation(bar, result.positions);
    const bool in_source = scheme.scheme.acceleration_depth == 0;
    table.AddRow({scheme.name, UpdatesTo(result.changes_mm, 1e-2 * kTranslationMm),
                  UpdatesTo(result.changes_mm, 1e-3 * kTranslationMm),
                  UpdatesTo(result.changes_mm, 1e-4 * kTranslationMm),
                  Cell(LargestDistance(result.after_update.at(10), result.positions)),
                  Cell(quality.total_volume_ratio), absl::StrCat(quality.inverted_tets),
                  in_source ? "usually converges in less than 10 steps" : "not in the source"});
  }
  return table;
}

CsvTable Convergence(const std::vector<NamedScheme>& schemes) {
  std::vector<std::string> header = {"update"};
  size_t longest = 0;
  for (const NamedScheme& scheme : schemes) {
    header.push_back(scheme.name + " [mm]");
    longest = std::max(longest, scheme.result.changes_mm.size());
  }
  CsvTable table(header);
  for (size_t update = 0; update < longest; ++update) {
    std::vector<std::string> row = {absl::StrCat(update + 1)};
    for (const NamedScheme& scheme : schemes) {
      const std::vector<double>& changes = scheme.result.changes_mm;
      row.push_back(update < changes.size() ? Cell(changes[update]) : "");
    }
    table.AddRow(row);
  }
  return table;
}

Chart ConvergenceChart(const std::vector<NamedScheme>& schemes) {
  Chart chart;
  chart.title = "Largest change of a vertex in one update";
  chart.x_title = "update";
  chart.y_title = "change [mm]";
  chart.logarithmic_y = true;
  for (const NamedScheme& scheme : schemes) {
    Curve curve{scheme.name, {}, {}, scheme.colour, scheme.style};
    for (const double change : scheme.result.changes_mm) {
      curve.x.push_back(static_cast<double>(curve.x.size()) + 1);
      curve.y.push_back(std::max(change, 1e-9));
    }
    chart.curves.push_back(std::move(curve));
  }
  return chart;
}

std::vector<Scene> Steps(const NamedScheme& scheme, const BoundarySurface& boundary) {
  std::vector<Scene> scenes;
  for (const int step : kShownSteps) {
    Scene scene;
    scene.title = absl::StrCat(scheme.name, ", step ", step);
    scene.surfaces = {
        {boundary.Pick(scheme.result.after_update.at(step)), boundary.mesh.triangles()}};
    scene.view = {{0.0, 1.0, 0.0}, {1.0, 0.0, 0.0}};
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

}  // namespace

absl::Status RunBlendExperiment(const ExperimentOptions& options) {
  TF_ASSIGN_OR_RETURN(TetMesh bar, BarMesh(CubeGrid({10, 10, 60}, 1)));
  const TranslationProblem problem{std::move(bar), kTranslationMm, options.threads};
  std::vector<NamedScheme> schemes = Schemes();
  for (NamedScheme& scheme : schemes) {
    TF_ASSIGN_OR_RETURN(scheme.result, TranslateByIteration(problem, scheme.scheme, kShownSteps));
  }
  TF_RETURN_IF_ERROR(Summary(problem.bar, schemes).WriteCsv(options.Path("fig4.csv")));
  TF_RETURN_IF_ERROR(Convergence(schemes).WriteCsv(options.Path("fig4_convergence.csv")));

  const BoundarySurface boundary = BoundaryOf(problem.bar);
  Figure figure("Fig. 4: bar of 36,000 tets, one end moved by half its length, plain iteration");
  figure.AddRow(300, Steps(schemes[0], boundary));
  figure.AddRow(300, Steps(schemes[1], boundary));
  figure.AddRow(420, {ConvergenceChart(schemes)});
  return figure.WritePng(options.Path("fig4.png"));
}

}  // namespace tissueform
