// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/experiments/twist_experiment.h"

#include "client/experiments/bar_twist.h"
#include "client/experiments/twist_figure.h"
#include "client/rendering/figure.h"
#include "core/base/status_macros.h"
#include "core/mesh/bar_mesh.h"

namespace tissueform {

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
