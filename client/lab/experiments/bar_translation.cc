// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/experiments/bar_translation.h"

#include <memory>
#include <utility>

#include "client/lab/accuracy/boundary_surface.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mechanics/deformation/rotation_estimation.h"
#include "core/mesh/operators/laplacian.h"
#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {
namespace {

HandlePose TranslationPose(const TranslationProblem& problem) {
  HandlePose pose;
  pose.translation_mm.x() = problem.translation_mm;
  return pose;
}

Eigen::VectorXd EvenStiffness(const TetMesh& mesh) {
  return Eigen::VectorXd::Ones(mesh.num_tets());
}

// The update that an answer is after: the first answer is the plain reconstruction.
int UpdatesOf(const Deformation& deformation) { return deformation.summary.iterations - 1; }

absl::StatusOr<CellField> HarmonicAtTets(const TranslationProblem& problem) {
  TF_ASSIGN_OR_RETURN(const ConstraintSet ends, ConstrainEnds(problem.bar.positions()));
  TF_ASSIGN_OR_RETURN(
      const auto laplacian,
      DirichletSystem::Create(
          CotangentLaplacian(problem.bar, EvenStiffness(problem.bar), problem.threads),
          ends.constrained(), {}));
  TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd fields, ComputeHarmonicFields(ends, laplacian.get()));
  return SampleAtBarycentres(problem.bar.tets(), fields);
}

}  // namespace

absl::StatusOr<Positions> TranslatePlainly(const TranslationProblem& problem) {
  TF_ASSIGN_OR_RETURN(const ConstraintSet ends, ConstrainEnds(problem.bar.positions()));
  GradientFieldOptions options;
  options.rotation = RotationMode::kNone;
  options.threads = problem.threads;
  TF_ASSIGN_OR_RETURN(
      const auto deformer,
      CreateGradientFieldDeformer(problem.bar, EvenStiffness(problem.bar), ends, options));
  TF_ASSIGN_OR_RETURN(Deformation deformation, deformer->Deform({TranslationPose(problem)}));
  return std::move(deformation.positions);
}

absl::StatusOr<TranslationResult> TranslateByIteration(const TranslationProblem& problem,
                                                       const IterationScheme& scheme,
                                                       const std::set<int>& keep) {
  TF_ASSIGN_OR_RETURN(const ConstraintSet ends, ConstrainEnds(problem.bar.positions()));
  GradientFieldOptions options;
  options.rotation = RotationMode::kEstimated;
  options.blend = scheme.blend;
  options.acceleration_depth = scheme.acceleration_depth;
  options.max_iterations = scheme.max_updates + 1;
  options.tolerance_mm = scheme.tolerance_mm;
  options.threads = problem.threads;
  TF_ASSIGN_OR_RETURN(
      const auto deformer,
      CreateGradientFieldDeformer(problem.bar, EvenStiffness(problem.bar), ends, options));
  TranslationResult result;
  DeformControl control;
  control.on_progress = [&](const Deformation& so_far) {
    if (keep.contains(UpdatesOf(so_far))) {
      result.after_update[UpdatesOf(so_far)] = so_far.positions;
    }
    return true;
  };
  TF_ASSIGN_OR_RETURN(Deformation deformation,
                      deformer->Deform({TranslationPose(problem)}, control));
  for (const int update : keep) result.after_update.try_emplace(update, deformation.positions);
  result.positions = std::move(deformation.positions);
  result.changes_mm = std::move(deformation.summary.changes_mm);
  result.converged = deformation.summary.converged;
  return result;
}

absl::StatusOr<Positions> TurnedAxes(const TranslationProblem& problem, const Positions& positions,
                                     BlendMap blend) {
  TF_ASSIGN_OR_RETURN(const CellField harmonic, HarmonicAtTets(problem));
  CellTransforms transforms;
  EstimateRotations(ElementsOf(problem.bar), positions, BlendWeights(harmonic, blend),
                    CellTransforms(), problem.threads, &transforms);
  // The third column of each row-major matrix: what becomes of the z axis.
  Positions axes(transforms.rows(), 3);
  axes << transforms.col(2), transforms.col(5), transforms.col(8);
  return axes;
}

double LargestDistance(const Positions& a, const Positions& b) {
  return (a - b).rowwise().norm().maxCoeff();
}

double MeanDistance(const Positions& a, const Positions& b) {
  return (a - b).rowwise().norm().mean();
}

}  // namespace tissueform
