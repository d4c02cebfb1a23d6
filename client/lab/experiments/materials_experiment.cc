// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/materials_experiment.h"

#include <utility>

#include "absl/strings/str_format.h"

#include "client/lab/experiments/twist_experiment.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mesh/bar_mesh.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

const Colour kSoftColour{0.90, 0.45, 0.38};
const Colour kStiffColour{0.45, 0.62, 0.86};

std::vector<Colour> MaterialColours(const TriangleMesh& surface, const StiffnessField& stiffness) {
  const CellField barycentres = SampleAtBarycentres(surface.triangles(), surface.positions());
  std::vector<Colour> colours;
  for (Eigen::Index f = 0; f < barycentres.rows(); ++f) {
    const bool soft = stiffness(barycentres.row(f).transpose()) == kSoftPa;
    colours.push_back(soft ? kSoftColour : kStiffColour);
  }
  return colours;
}

absl::Status Draw(const TwistProblem& problem, const std::vector<NamedTwist>& twists,
                  const std::string& path) {
  const TriangleMesh surface = BoundaryOf(problem.bar).mesh;
  TwistResult rest;
  rest.boundary_positions = surface.positions();
  std::vector<Scene> scenes = {
      TwistScene(
          absl::StrFormat("at rest: soft (red), %.0f times stiffer (blue)", kStiffPa / kSoftPa),
          rest, surface.triangles()),
      TwistScene("volume mesh", *twists[0].result, surface.triangles()),
      TwistScene("surface mesh", *twists[1].result, surface.triangles())};
  for (Scene& scene : scenes) {
    scene.surfaces.front().triangle_colours = MaterialColours(surface, problem.stiffness);
  }
  Figure figure("Fig. 5: bar of two materials, one end turned by 360\u00b0");
  figure.AddRow(300, std::move(scenes));
  figure.AddRow(420, {SectionChart(twists)});
  return figure.WritePng(path);
}

}  // namespace

absl::StatusOr<TwistProblem> TwoMaterialBar(const std::array<int, 3>& cells, int threads) {
  TF_ASSIGN_OR_RETURN(TetMesh bar, BarMesh(CubeGrid(cells, 1)));
  const double middle = cells[2] / 2.0;
  const StiffnessField stiffness = [middle](const Eigen::Vector3d& position) {
    return position.z() < middle ? kSoftPa : kStiffPa;
  };
  return TwistProblem{std::move(bar), stiffness, 360, threads};
}

absl::Status RunMaterialsExperiment(const ExperimentOptions& options) {
  TF_ASSIGN_OR_RETURN(const TwistProblem problem, TwoMaterialBar({10, 10, 60}, options.threads));
  TF_ASSIGN_OR_RETURN(const TwistResult volume, TwistVolume(problem));
  TF_ASSIGN_OR_RETURN(const TwistResult surface, TwistSurface(problem));
  const std::vector<NamedTwist> twists = {{"volume", &volume, kBlue},
                                          {"surface", &surface, kOrange}};
  TF_RETURN_IF_ERROR(TwistSummary(twists, {"the soft part deforms more; volume kept as before",
                                           "shrinks as before"})
                         .WriteCsv(options.Path("fig5.csv")));
  TF_RETURN_IF_ERROR(SectionTable(twists).WriteCsv(options.Path("fig5_sections.csv")));
  return Draw(problem, twists, options.Path("fig5.png"));
}

}  // namespace tissueform
