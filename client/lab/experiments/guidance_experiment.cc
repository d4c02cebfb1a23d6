// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/guidance_experiment.h"

#include <utility>

#include "client/lab/experiments/twist_experiment.h"
#include "core/base/status_macros.h"
#include "core/mesh/bar_mesh.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

// What one guidance makes of the bar.
struct GuidedTwist {
  Eigen::VectorXd field;  // #V of the bar
  TwistResult result;
};

absl::StatusOr<GuidedTwist> Guide(const TwistProblem& problem, Guidance guidance) {
  GuidedTwist twist;
  TF_ASSIGN_OR_RETURN(twist.field, TwistField(problem, guidance));
  TF_ASSIGN_OR_RETURN(twist.result, TwistVolume(problem, guidance));
  return twist;
}

Scene FieldScene(std::string title, const BoundarySurface& boundary, const Eigen::VectorXd& field) {
  TwistResult rest;
  rest.boundary_positions = boundary.mesh.positions();
  Scene scene = TwistScene(std::move(title), rest, boundary.mesh.triangles());
  scene.surfaces.front().vertex_values = field(boundary.vertices);
  scene.colour_bar = {"harmonic field: share of the turn", 0, 1};
  return scene;
}

absl::Status Draw(const TwistProblem& problem, const GuidedTwist& cotangent,
                  const GuidedTwist& uniform, const std::vector<NamedTwist>& twists,
                  const std::string& path) {
  const BoundarySurface boundary = BoundaryOf(problem.bar);
  const TriangleIndices& triangles = boundary.mesh.triangles();
  Figure figure("Fig. 6: bar with one half finer, one end turned by 360\u00b0");
  figure.AddRow(320, {FieldScene("cotangent field", boundary, cotangent.field),
                      FieldScene("uniform field", boundary, uniform.field)});
  figure.AddRow(270, {TwistScene("guided by the cotangent field", cotangent.result, triangles),
                      TwistScene("guided by the uniform field", uniform.result, triangles)});
  figure.AddRow(400, {SectionChart(twists)});
  return figure.WritePng(path);
}

}  // namespace

absl::StatusOr<TwistProblem> GradedBar(int across, int coarse, int fine, int threads) {
  GridPlanes planes = CubeGrid({across, across, 1}, 1);
  const double length = 6.0 * across;
  planes.z = EvenPlanes(0, length / 2, coarse);
  planes.z.pop_back();
  const std::vector<double> upper = EvenPlanes(length / 2, length, fine);
  planes.z.insert(planes.z.end(), upper.begin(), upper.end());
  TF_ASSIGN_OR_RETURN(TetMesh bar, BarMesh(planes));
  return TwistProblem{std::move(bar), {}, 360, threads};
}

double DistanceFromLine(const TetMesh& bar, const Eigen::VectorXd& field) {
  const Eigen::VectorXd z = bar.positions().col(2);
  return (field - z / z.maxCoeff()).cwiseAbs().maxCoeff();
}

absl::Status RunGuidanceExperiment(const ExperimentOptions& options) {
  TF_ASSIGN_OR_RETURN(const TwistProblem problem, GradedBar(7, 14, 42, options.threads));
  TF_ASSIGN_OR_RETURN(const GuidedTwist cotangent, Guide(problem, Guidance::kCotangent));
  TF_ASSIGN_OR_RETURN(const GuidedTwist uniform, Guide(problem, Guidance::kUniform));
  const std::vector<NamedTwist> twists = {{"cotangent", &cotangent.result, kBlue},
                                          {"uniform", &uniform.result, kOrange}};
  TF_RETURN_IF_ERROR(
      TwistSummary(twists, {"smooth and natural", "asymmetrical field; unnatural shrinking"})
          .WriteCsv(options.Path("fig6.csv")));
  CsvTable fields({"case", "largest_distance_from_line"});
  fields.AddRow({"cotangent", Cell(DistanceFromLine(problem.bar, cotangent.field))});
  fields.AddRow({"uniform", Cell(DistanceFromLine(problem.bar, uniform.field))});
  TF_RETURN_IF_ERROR(fields.WriteCsv(options.Path("fig6_fields.csv")));
  TF_RETURN_IF_ERROR(SectionTable(twists).WriteCsv(options.Path("fig6_sections.csv")));
  return Draw(problem, cotangent, uniform, twists, options.Path("fig6.png"));
}

}  // namespace tissueform
