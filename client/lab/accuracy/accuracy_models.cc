// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/accuracy_models.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/create_response.h"

namespace tissueform {
namespace {

// Plenty: the fixed point is compared, not a number of steps.
constexpr int kMaxEstimations = 200;
// A hundredth of the default, so that what is left against CalculiX (4e-5 mm at most,
// docs/accuracy.md) is not where the search stopped.
constexpr double kNeoHookeanTolerance = 1e-6;

DeformerOptions OptionsOf(const ModelVariant& variant) {
  DeformerOptions options;
  options.model = variant.model;
  options.gradient_field.rotation = variant.rotation;
  options.gradient_field.max_iterations = kMaxEstimations;
  options.neo_hookean.tolerance = kNeoHookeanTolerance;
  return options;
}

absl::StatusOr<std::shared_ptr<MeshPreparation>> Prepare(const AccuracyCase& problem,
                                                         double poisson_ratio) {
  PreparationOptions options;
  options.poisson_ratio = poisson_ratio;
  return MeshPreparation::Create(problem.mesh, problem.stiffness, problem.constraints,
                                 std::move(options));
}

// At all vertices, with the settings of a drag but for how far handles may turn: as far as these.
absl::StatusOr<Deformation> AnswerFromPrepared(const std::shared_ptr<MeshPreparation>& preparation,
                                               DeformationModel model,
                                               const AccuracyCase& problem) {
  ResponseOptions options{.model = model};
  for (const HandlePose& pose : problem.poses) {
    options.max_rotation_rad = std::max(options.max_rotation_rad, pose.rotation_vector.norm());
  }
  std::vector<int32_t> all(static_cast<size_t>(problem.mesh.num_vertices()));
  std::iota(all.begin(), all.end(), 0);
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<VertexResponse> response,
                      CreateResponse(preparation, all, options));
  FloatPositions positions;
  response->Evaluate(problem.poses, &positions);
  return Deformation{.positions = positions.cast<double>(), .summary = {}};
}

absl::StatusOr<Deformation> Answer(const std::shared_ptr<MeshPreparation>& preparation,
                                   const ModelVariant& variant, const AccuracyCase& problem) {
  if (variant.is_prepared) return AnswerFromPrepared(preparation, variant.model, problem);
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<Deformer> deformer,
                      CreateDeformer(preparation, OptionsOf(variant)));
  return deformer->Deform(problem.poses);
}

}  // namespace

const std::vector<ModelVariant>& AllModelVariants() {
  using enum DeformationModel;
  static const auto* const kVariants = new std::vector<ModelVariant>{
      {"plain_poisson", "plain Poisson", kGradientField, RotationMode::kNone, false},
      {"gradient_field_propagated", "gradient field, propagated", kGradientField,
       RotationMode::kPropagated, false},
      {"gradient_field_estimated", "gradient field, estimated", kGradientField,
       RotationMode::kEstimated, false},
      {"arap", "ARAP", kArap, RotationMode::kPropagated, false},
      {"linear_elastic", "linear elastic", kLinearElastic, RotationMode::kPropagated, true},
      {"neo_hookean_prepared", "neo-Hookean, prepared", kNeoHookean, RotationMode::kPropagated,
       true, true},
      {"neo_hookean", "neo-Hookean", kNeoHookean, RotationMode::kPropagated, true},
  };
  return *kVariants;
}

absl::StatusOr<ModelAnswer> AnswerByModel(const ModelVariant& variant, const AccuracyCase& problem,
                                          double poisson_ratio) {
  const Stopwatch stopwatch;
  TF_ASSIGN_OR_RETURN(const auto preparation, Prepare(problem, poisson_ratio));
  TF_ASSIGN_OR_RETURN(Deformation deformation, Answer(preparation, variant, problem));
  const double seconds = stopwatch.Seconds();
  const Eigen::Index inverted =
      MeasureDeformation(problem.mesh, deformation.positions).inverted_tets;
  return ModelAnswer{variant.name, std::move(deformation.positions), seconds, inverted,
                     deformation.summary.converged};
}

CalculixProblem ForCalculix(const AccuracyCase& problem, double poisson_ratio, CalculixLaw law) {
  return {problem.mesh,
          problem.stiffness,
          poisson_ratio,
          problem.constraints,
          ConstrainedDisplacements(problem.mesh, problem.constraints, problem.poses),
          law,
          /*forces_and_stresses=*/false,
          BoneMotions(problem.mesh, problem.constraints, problem.poses)};
}

absl::StatusOr<ModelAnswer> AnswerByCalculix(CalculixLaw law, const AccuracyCase& problem,
                                             double poisson_ratio, const std::string& folder) {
  TF_ASSIGN_OR_RETURN(CalculixResult result,
                      RunCalculix(ForCalculix(problem, poisson_ratio, law), folder));
  const Eigen::Index inverted = MeasureDeformation(problem.mesh, result.deformed).inverted_tets;
  return ModelAnswer{law == CalculixLaw::kLinear ? "calculix_linear" : "calculix_neo_hookean",
                     std::move(result.deformed), result.seconds, inverted, true};
}

}  // namespace tissueform
