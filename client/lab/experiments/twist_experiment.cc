// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/twist_experiment.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/bar_mesh.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {

View LyingBarView() { return {{0.25, 1.0, 0.3}, {1.0, 0.0, 0.0}}; }

Scene TwistScene(std::string title, const TwistResult& result, const TriangleIndices& triangles) {
  Scene scene;
  scene.title = std::move(title);
  scene.surfaces = {{result.boundary_positions, triangles}};
  scene.view = LyingBarView();
  return scene;
}

Chart SectionChart(const std::vector<NamedTwist>& twists) {
  Chart chart;
  chart.title = "Section area along the bar";
  chart.x_title = "position along the bar at rest [mm]";
  chart.y_title = "area / area at rest";
  chart.y_low = 0;
  chart.y_high = 1.1;
  for (const NamedTwist& twist : twists) {
    chart.curves.push_back(
        {twist.name, twist.result->heights_mm, twist.result->section_ratios, twist.colour});
  }
  return chart;
}

CsvTable SectionTable(const std::vector<NamedTwist>& twists) {
  std::vector<std::string> header = {"position_mm"};
  for (const NamedTwist& twist : twists) header.push_back(twist.name);
  CsvTable table(header);
  const std::vector<double>& heights = twists.front().result->heights_mm;
  for (size_t s = 0; s < heights.size(); ++s) {
    std::vector<std::string> row = {Cell(heights[s])};
    for (const NamedTwist& twist : twists) row.push_back(Cell(twist.result->section_ratios[s]));
    table.AddRow(row);
  }
  return table;
}

CsvTable TwistSummary(const std::vector<NamedTwist>& twists,
                      const std::vector<std::string>& source_says) {
  CsvTable table({"case", "volume_ratio", "smallest_section_ratio", "largest_section_ratio",
                  "turn_at_middle_deg", "inverted_tets", "source_says"});
  for (size_t t = 0; t < twists.size(); ++t) {
    const TwistResult& result = *twists[t].result;
    table.AddRow({twists[t].name, Cell(result.volume_ratio), Cell(result.SmallestSection()),
                  Cell(result.LargestSection()), Cell(result.turn_at_middle_deg),
                  absl::StrCat(result.inverted_tets), source_says[t]});
  }
  return table;
}

absl::Status RunTwistExperiment(const ExperimentOptions& options) {
  TF_ASSIGN_OR_RETURN(const TetMesh bar, BarMesh(CubeGrid({10, 10, 60}, 1)));
  const TwistProblem problem{bar, {}, 360, options.threads};
  TF_ASSIGN_OR_RETURN(const TwistResult volume, TwistVolume(problem));
  TF_ASSIGN_OR_RETURN(const TwistResult surface, TwistSurface(problem));
  const std::vector<NamedTwist> twists = {{"volume", &volume, kBlue},
                                          {"surface", &surface, kOrange}};
  TF_RETURN_IF_ERROR(
      TwistSummary(twists, {"much better volume preservation", "obvious shrinking and volume loss"})
          .WriteCsv(options.Path("fig1.csv")));
  TF_RETURN_IF_ERROR(SectionTable(twists).WriteCsv(options.Path("fig1_sections.csv")));

  const TriangleIndices triangles = BoundaryOf(bar).mesh.triangles();
  Figure figure("Fig. 1: bar of 36,000 tets, one end turned by 360\u00b0");
  figure.AddRow(330, {TwistScene("tetrahedral volume mesh", volume, triangles),
                      TwistScene("its boundary surface mesh", surface, triangles)});
  figure.AddRow(420, {SectionChart(twists)});
  return figure.WritePng(options.Path("fig1.png"));
}

}  // namespace tissueform
