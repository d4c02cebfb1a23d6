// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/block_pull_experiment.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "client/lab/accuracy/boundary_surface.h"
#include "client/lab/experiments/surface_measures.h"
#include "core/base/csv_table.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mesh/bar_mesh.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

constexpr double kWayMm = 5;
const View kFromAbove{{0.35, -1.0, 0.75}, {0, 0, 1}};
const View kFromBelow{{0.35, -1.0, -0.6}, {0, 0, 1}};

// Vertices at height `z` within the handle's radius of the block's middle.
std::vector<int32_t> Patch(const BlockProblem& problem, const Positions& positions, double z) {
  const Positions& rest = problem.block.positions();
  const Eigen::RowVector3d middle = (rest.colwise().minCoeff() + rest.colwise().maxCoeff()) / 2;
  return VerticesWhere(positions, [&, z](const Eigen::Vector3d& v) {
    return v.z() == z &&
           std::hypot(v.x() - middle.x(), v.y() - middle.y()) <= problem.handle_radius_mm;
  });
}

absl::StatusOr<ConstraintSet> Constrain(const BlockProblem& problem, const Positions& positions) {
  const double low = positions.col(0).minCoeff();
  const double high = positions.col(0).maxCoeff();
  return ConstraintSet::Create(
      positions.rows(),
      VerticesWhere(positions,
                    [=](const Eigen::Vector3d& v) { return v.x() == low || v.x() == high; }),
      {{"centre", Patch(problem, positions, positions.col(2).maxCoeff())}});
}

GradientFieldOptions EstimatedOptions(const BlockProblem& problem) {
  GradientFieldOptions options;
  options.rotation = RotationMode::kEstimated;
  options.max_iterations = 100;
  options.threads = problem.threads;
  return options;
}

HandlePose PullPose(double way_mm) {
  HandlePose pose;
  pose.translation_mm.z() = way_mm;
  return pose;
}

PullResult Measure(const BlockProblem& problem, const TriangleMesh& rest, double way_mm,
                   Positions deformed, const SolveSummary& summary) {
  const TriangleIndices& triangles = rest.triangles();
  const std::vector<int32_t> below =
      Patch(problem, rest.positions(), rest.positions().col(2).minCoeff());
  PullResult result;
  result.volume_ratio =
      EnclosedVolume(deformed, triangles) / EnclosedVolume(rest.positions(), triangles);
  result.self_intersections = CountSelfIntersections(deformed, triangles);
  result.bottom_share =
      (deformed(below, 2).array() - rest.positions()(below, 2).array()).mean() / way_mm;
  result.iterations = summary.iterations;
  result.converged = summary.converged;
  result.boundary_positions = std::move(deformed);
  return result;
}

struct NamedPull {
  std::string name;
  PullResult result;
  std::string source_says;
};

CsvTable Summary(const std::vector<NamedPull>& pulls) {
  CsvTable table({"case", "volume_ratio", "self_intersections", "inverted_tets", "bottom_share",
                  "iterations", "converged", "source_says"});
  for (const NamedPull& pull : pulls) {
    const PullResult& result = pull.result;
    table.AddRow({pull.name, Cell(result.volume_ratio), absl::StrCat(result.self_intersections),
                  absl::StrCat(result.inverted_tets), Cell(result.bottom_share),
                  absl::StrCat(result.iterations), result.converged ? "yes" : "no",
                  pull.source_says});
  }
  return table;
}

absl::Status Draw(const std::vector<NamedPull>& pulls, const TriangleIndices& triangles,
                  const std::string& path) {
  const auto scene = [&](const NamedPull& pull, const std::string& from, const View& view) {
    Scene panel;
    panel.title = pull.name + from;
    panel.surfaces = {{pull.result.boundary_positions, triangles}};
    panel.view = view;
    return panel;
  };
  Figure figure("Fig. 2: block of three layers of tets, sides fixed, center of the top moved");
  for (size_t row = 0; row < pulls.size(); row += 2) {
    std::vector<Scene> scenes;
    for (size_t p = row; p < row + 2; ++p) {
      scenes.push_back(scene(pulls[p], "", kFromAbove));
      scenes.push_back(scene(pulls[p], ", from below", kFromBelow));
    }
    figure.AddRow(218, std::move(scenes));
  }
  return figure.WritePng(path);
}

}  // namespace

absl::StatusOr<BlockProblem> SoftTissueBlock(const std::array<int, 3>& cells, int threads) {
  TF_ASSIGN_OR_RETURN(TetMesh block, BarMesh(CubeGrid(cells, 1)));
  return BlockProblem{std::move(block), std::min(cells[0], cells[1]) / 6.0, threads};
}

absl::StatusOr<PullResult> PullVolume(const BlockProblem& problem, double way_mm) {
  const TetMesh& block = problem.block;
  TF_ASSIGN_OR_RETURN(const ConstraintSet constraints, Constrain(problem, block.positions()));
  TF_ASSIGN_OR_RETURN(const auto deformer,
                      CreateGradientFieldDeformer(block, Eigen::VectorXd::Ones(block.num_tets()),
                                                  constraints, EstimatedOptions(problem)));
  TF_ASSIGN_OR_RETURN(const Deformation deformation, deformer->Deform({PullPose(way_mm)}));
  const BoundarySurface boundary = BoundaryOf(block);
  PullResult result = Measure(problem, boundary.mesh, way_mm, boundary.Pick(deformation.positions),
                              deformation.summary);
  result.inverted_tets = MeasureDeformation(block, deformation.positions).inverted_tets;
  return result;
}

absl::StatusOr<PullResult> PullSurface(const BlockProblem& problem, double way_mm) {
  const TriangleMesh surface = BoundaryOf(problem.block).mesh;
  TF_ASSIGN_OR_RETURN(const ConstraintSet constraints, Constrain(problem, surface.positions()));
  TF_ASSIGN_OR_RETURN(
      const auto deformer,
      CreateSurfaceGradientFieldDeformer(surface, Eigen::VectorXd::Ones(surface.num_triangles()),
                                         constraints, EstimatedOptions(problem)));
  TF_ASSIGN_OR_RETURN(Deformation deformation, deformer->Deform({PullPose(way_mm)}));
  return Measure(problem, surface, way_mm, std::move(deformation.positions), deformation.summary);
}

absl::Status RunBlockPullExperiment(const ExperimentOptions& options) {
  TF_ASSIGN_OR_RETURN(const BlockProblem problem, SoftTissueBlock({24, 16, 3}, options.threads));
  std::vector<NamedPull> pulls = {{"volume, drag", {}, "natural and intuitive"},
                                  {"volume, push", {}, "natural and intuitive"},
                                  {"surface, drag", {}, "unnatural volume changes"},
                                  {"surface, push", {}, "serious local self-intersection"}};
  TF_ASSIGN_OR_RETURN(pulls[0].result, PullVolume(problem, kWayMm));
  TF_ASSIGN_OR_RETURN(pulls[1].result, PullVolume(problem, -kWayMm));
  TF_ASSIGN_OR_RETURN(pulls[2].result, PullSurface(problem, kWayMm));
  TF_ASSIGN_OR_RETURN(pulls[3].result, PullSurface(problem, -kWayMm));
  TF_RETURN_IF_ERROR(Summary(pulls).WriteCsv(options.Path("fig2.csv")));
  return Draw(pulls, BoundaryOf(problem.block).mesh.triangles(), options.Path("fig2.png"));
}

}  // namespace tissueform
