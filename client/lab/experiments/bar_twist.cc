// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/bar_twist.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "client/lab/accuracy/boundary_surface.h"
#include "client/lab/experiments/surface_measures.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mesh/operators/edge_laplacian.h"
#include "core/mesh/operators/laplacian.h"

namespace tissueform {
namespace {

constexpr int kSections = 60;

Eigen::VectorXd SampleStiffness(const StiffnessField& field, const Positions& positions,
                                const Eigen::Ref<const CellIndices>& cells) {
  Eigen::VectorXd stiffness = Eigen::VectorXd::Ones(cells.rows());
  if (!field) return stiffness;
  const CellField barycentres = SampleAtBarycentres(cells, positions);
  for (Eigen::Index c = 0; c < cells.rows(); ++c) {
    stiffness[c] = field(barycentres.row(c).transpose());
  }
  return stiffness;
}

HandlePose TwistPose(const TwistProblem& problem) {
  const Positions& rest = problem.bar.positions();
  HandlePose pose;
  pose.rotation_vector.z() = problem.angle_deg * std::numbers::pi / 180;
  pose.pivot_mm = (rest.colwise().minCoeff() + rest.colwise().maxCoeff()) / 2;
  return pose;
}

// Planes half a step from each end and a step from each other, so that none lies in an end.
std::vector<double> SectionHeights(const Positions& rest) {
  const double low = rest.col(2).minCoeff();
  const double step = (rest.col(2).maxCoeff() - low) / kSections;
  std::vector<double> heights;
  heights.reserve(kSections);
  for (int s = 0; s < kSections; ++s) heights.push_back(low + step * (s + 0.5));
  return heights;
}

// The turn about the bar's axis that fits the vertices best that lie halfway along the rest bar.
double TurnAtMiddleDeg(const Positions& rest, const Positions& deformed) {
  const Eigen::RowVector3d middle = (rest.colwise().minCoeff() + rest.colwise().maxCoeff()) / 2;
  const Eigen::ArrayXd distances = (rest.col(2).array() - middle.z()).abs();
  const double nearest = distances.minCoeff() * (1 + 1e-9) + 1e-9;
  // Least squares over turns in a plane has this closed form. No angle is taken of a single vertex,
  // which may lie on the axis.
  double dot = 0;
  double cross = 0;
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    if (distances[v] > nearest) continue;
    const Eigen::RowVector2d before = (rest.row(v) - middle).head<2>();
    const Eigen::RowVector2d after = (deformed.row(v) - middle).head<2>();
    dot += before.dot(after);
    cross += before.x() * after.y() - before.y() * after.x();
  }
  const double turn = std::atan2(cross, dot) * 180 / std::numbers::pi;
  return turn < 0 ? turn + 360 : turn;
}

TwistResult Measure(const TriangleMesh& rest, Positions deformed) {
  TwistResult result;
  result.volume_ratio = EnclosedVolume(deformed, rest.triangles()) /
                        EnclosedVolume(rest.positions(), rest.triangles());
  result.heights_mm = SectionHeights(rest.positions());
  const std::vector<double> before =
      SectionAreas(rest.positions(), rest.triangles(), result.heights_mm);
  result.section_ratios = SectionAreas(deformed, rest.triangles(), result.heights_mm);
  for (size_t s = 0; s < before.size(); ++s) result.section_ratios[s] /= before[s];
  result.turn_at_middle_deg = TurnAtMiddleDeg(rest.positions(), deformed);
  result.boundary_positions = std::move(deformed);
  return result;
}

}  // namespace

double TwistResult::SmallestSection() const {
  return *std::min_element(section_ratios.begin(), section_ratios.end());
}

double TwistResult::LargestSection() const {
  return *std::max_element(section_ratios.begin(), section_ratios.end());
}

absl::StatusOr<TwistResult> TwistVolume(const TwistProblem& problem, Guidance guidance) {
  const TetMesh& bar = problem.bar;
  TF_ASSIGN_OR_RETURN(const ConstraintSet ends, ConstrainEnds(bar.positions()));
  GradientFieldOptions options;
  options.guidance = guidance;
  options.threads = problem.threads;
  TF_ASSIGN_OR_RETURN(
      const std::unique_ptr<Deformer> deformer,
      CreateGradientFieldDeformer(
          bar, SampleStiffness(problem.stiffness, bar.positions(), bar.tets()), ends, options));
  TF_ASSIGN_OR_RETURN(const Deformation deformation, deformer->Deform({TwistPose(problem)}));
  const BoundarySurface boundary = BoundaryOf(bar);
  TwistResult result = Measure(boundary.mesh, boundary.Pick(deformation.positions));
  result.inverted_tets = MeasureDeformation(bar, deformation.positions).inverted_tets;
  return result;
}

absl::StatusOr<TwistResult> TwistSurface(const TwistProblem& problem) {
  const TriangleMesh surface = BoundaryOf(problem.bar).mesh;
  TF_ASSIGN_OR_RETURN(const ConstraintSet ends, ConstrainEnds(surface.positions()));
  GradientFieldOptions options;
  options.threads = problem.threads;
  TF_ASSIGN_OR_RETURN(
      const std::unique_ptr<Deformer> deformer,
      CreateSurfaceGradientFieldDeformer(
          surface, SampleStiffness(problem.stiffness, surface.positions(), surface.triangles()),
          ends, options));
  TF_ASSIGN_OR_RETURN(Deformation deformation, deformer->Deform({TwistPose(problem)}));
  return Measure(surface, std::move(deformation.positions));
}

absl::StatusOr<Eigen::VectorXd> TwistField(const TwistProblem& problem, Guidance guidance) {
  const TetMesh& bar = problem.bar;
  TF_ASSIGN_OR_RETURN(const ConstraintSet ends, ConstrainEnds(bar.positions()));
  const SparseMatrix L =
      guidance == Guidance::kUniform
          ? UniformLaplacian(bar.tets(), bar.num_vertices(), problem.threads)
          : CotangentLaplacian(bar, SampleStiffness(problem.stiffness, bar.positions(), bar.tets()),
                               problem.threads);
  TF_ASSIGN_OR_RETURN(const auto laplacian, DirichletSystem::Create(L, ends.constrained(), {}));
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd fields, ComputeHarmonicFields(ends, laplacian.get()));
  return Eigen::VectorXd(fields.col(0));
}

}  // namespace tissueform
