// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/gradient_field_deformer.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/anderson_acceleration.h"
#include "core/mechanics/deformation/contact_reconstruction.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/handle_targets.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mechanics/deformation/poisson_reconstruction.h"
#include "core/mechanics/deformation/rotation_propagation.h"
#include "core/mesh/operators/edge_laplacian.h"
#include "core/mesh/operators/laplacian.h"
#include "core/mesh/operators/piecewise_linear_elements.h"

namespace tissueform {
namespace {

// What a deformer reads and shares with others: of a mesh preparation, or of a surface.
struct SharedParts {
  std::shared_ptr<const void> owner;
  const PiecewiseLinearElements& elements;
  const VertexCells& vertex_cells;
  const Eigen::VectorXd& stiffness;
  const ConstraintSet& constraints;
  PreparedLaplacian* laplacian;
  int64_t bytes;
};

class GradientFieldDeformer : public Deformer {
 public:
  GradientFieldDeformer(SharedParts parts, GradientFieldOptions options)
      : parts_(std::move(parts)),
        elements_(parts_.elements),
        laplacian_(*parts_.laplacian->system),
        options_(std::move(options)),
        reconstruction_(*parts_.laplacian) {}

  absl::Status Prepare(const Cancellation& cancellation) {
    preparation_.assemble_seconds = parts_.laplacian->assemble_seconds;
    preparation_.negative_weights = parts_.laplacian->negative_weights;
    const FactorizationSummary& factorization = laplacian_.factorization();
    preparation_.analyse_seconds = factorization.analyse_seconds;
    preparation_.factorise_seconds = factorization.factorise_seconds;
    preparation_.factor_bytes = factorization.factor_bytes;
    TF_RETURN_IF_ERROR(PrepareHarmonicFields(cancellation));
    preparation_.own_bytes = DoublesHeld() * static_cast<int64_t>(sizeof(double));
    preparation_.bytes_held = parts_.bytes + preparation_.own_bytes;
    return absl::OkStatus();
  }

  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                     const DeformControl& control) override {
    TF_RETURN_IF_ERROR(CheckPoses(parts_.constraints, poses));
    const Stopwatch stopwatch;
    const HandleTargets target = MakeHandleTargets(parts_.constraints, elements_.rest, poses);
    if (options_.rotation != RotationMode::kNone) {
      PropagateRotations(elements_, harmonic(), poses, options_.threads, &propagated_);
    }
    if (options_.rotation == RotationMode::kEstimated) {
      return Iterate(target, control, stopwatch);
    }
    TransformsToCornerLoads(elements_, parts_.stiffness, options_.threads, &propagated_);
    TF_ASSIGN_OR_RETURN(const ContactReconstruction::Answer answer,
                        Reconstruct(propagated_, target));
    Deformation deformation;
    Describe(answer, target, &deformation);
    deformation.summary.converged = answer.converged;
    deformation.summary.solve_seconds = stopwatch.Seconds();
    deformation.summary.residual = last_residual_;
    return deformation;
  }

  const PreparationSummary& preparation() const override { return preparation_; }

 private:
  // The preparation's, or our own ones.
  const Eigen::MatrixXd& harmonic() const {
    return uniform_harmonic_.size() > 0 ? uniform_harmonic_ : parts_.laplacian->harmonic;
  }

  int64_t DoublesHeld() const {
    return uniform_harmonic_.size() + blend_weights_.size() + TransformDoubles();
  }

  // What the transforms of poses will hold, at most.
  Eigen::Index TransformDoubles() const {
    int kinds = options_.rotation == RotationMode::kNone ? 0 : 1;
    if (options_.rotation == RotationMode::kEstimated) {
      ++kinds;  // estimated ones beside propagated ones
    }
    return kinds * CellTransforms::ColsAtCompileTime * elements_.num_cells();
  }

  absl::Status PrepareHarmonicFields(const Cancellation& cancellation) {
    const Stopwatch stopwatch;
    if (options_.guidance == Guidance::kUniform) {
      // Its factor is given back as soon as the fields are known.
      TF_ASSIGN_OR_RETURN(
          const auto uniform,
          DirichletSystem::Create(
              UniformLaplacian(elements_.cells, elements_.num_vertices(), options_.threads),
              GuidedVertices(parts_.constraints), {options_.backend, options_.admission},
              cancellation));
      TF_ASSIGN_OR_RETURN(uniform_harmonic_,
                          ComputeHarmonicFields(parts_.constraints, uniform.get()));
    }
    preparation_.harmonic_min = harmonic().minCoeff();
    preparation_.harmonic_max = harmonic().maxCoeff();
    if (options_.rotation == RotationMode::kEstimated) {
      blend_weights_ =
          BlendWeights(SampleAtBarycentres(elements_.cells, harmonic()), options_.blend);
    }
    preparation_.prepare_seconds = parts_.laplacian->harmonic_seconds + stopwatch.Seconds();
    return absl::OkStatus();
  }

  // One linear solve under the loads of turned cells (empty: not turned).
  absl::StatusOr<ContactReconstruction::Answer> Reconstruct(const CornerLoads& loads,
                                                            const HandleTargets& target) {
    Eigen::MatrixXd rhs =
        GatherCornerLoads(parts_.vertex_cells, elements_.num_vertices(), loads, options_.threads);
    TF_ASSIGN_OR_RETURN(ContactReconstruction::Answer answer, reconstruction_.Solve(target, &rhs));
    if (options_.compute_residual) {
      last_residual_ = laplacian_.RelativeResidual(rhs, answer.displacements);
    }
    return answer;
  }

  void Describe(const ContactReconstruction::Answer& answer, const HandleTargets& target,
                Deformation* deformation) const {
    deformation->positions =
        ToPositions(parts_.constraints, elements_.rest, answer.displacements, target);
    deformation->contact = reconstruction_.Describe(answer.displacements, answer.forces, target);
  }

  // Fixed-point iteration of the `estimated` mode: estimate rotations, blend, reconstruct.
  absl::StatusOr<Deformation> Iterate(const HandleTargets& target, const DeformControl& control,
                                      const Stopwatch& stopwatch) {
    if (!control.warm_start || last_loads_.rows() == 0) {
      last_loads_ = propagated_;
      TransformsToCornerLoads(elements_, parts_.stiffness, options_.threads, &last_loads_);
    }
    AndersonAcceleration acceleration(options_.acceleration_depth);
    TF_ASSIGN_OR_RETURN(const ContactReconstruction::Answer first,
                        Reconstruct(last_loads_, target));
    Deformation deformation;
    SolveSummary& summary = deformation.summary;
    summary.converged = false;
    // Positions are computed only when a caller reads them.
    const auto report = [&](const ContactReconstruction::Answer& answer) {
      summary.solve_seconds = stopwatch.Seconds();
      summary.residual = last_residual_;
      const bool last = summary.converged || summary.iterations >= options_.max_iterations;
      if (last || control.on_progress) Describe(answer, target, &deformation);
      summary.cancelled = !last && control.on_progress && !control.on_progress(deformation);
    };
    report(first);
    Eigen::MatrixXd iterate = first.displacements;
    while (!summary.converged && !summary.cancelled &&
           summary.iterations < options_.max_iterations) {
      EstimateRotations(elements_, elements_.rest + iterate, blend_weights_, propagated_,
                        options_.threads, &last_loads_);
      TransformsToCornerLoads(elements_, parts_.stiffness, options_.threads, &last_loads_);
      TF_ASSIGN_OR_RETURN(const ContactReconstruction::Answer image,
                          Reconstruct(last_loads_, target));
      ++summary.iterations;
      // By what the plain step does, not the accelerated one: only that is zero at the fixed point
      // and nowhere else.
      summary.changes_mm.push_back((image.displacements - iterate).rowwise().norm().maxCoeff());
      summary.converged = image.converged && summary.changes_mm.back() <= options_.tolerance_mm;
      // The image, not the extrapolated iterate, is what is shown and answered: it is the Poisson
      // reconstruction of rotations, which an extrapolation is not.
      report(image);
      iterate = acceleration.Next(iterate, image.displacements);
    }
    return deformation;
  }

  // Constant after Prepare.
  const SharedParts parts_;
  const PiecewiseLinearElements& elements_;
  const DirichletSystem& laplacian_;
  const GradientFieldOptions options_;
  Eigen::MatrixXd uniform_harmonic_;  // #V by #handles; empty unless guidance is uniform
  Eigen::VectorXd blend_weights_;     // #C; empty unless rotations are estimated
  PreparationSummary preparation_;

  ContactReconstruction reconstruction_;  // holds workspaces
  double last_residual_ = 0;
  // Of the last poses; their loads once a mode that does not iterate has them. No rows in mode
  // kNone.
  CellTransforms propagated_;
  // Those of the last answer's estimated transforms, from which a warm start goes on; empty before
  // the first.
  CornerLoads last_loads_;
};

absl::Status CheckAreas(const PiecewiseLinearElements& elements) {
  for (Eigen::Index f = 0; f < elements.measures.size(); ++f) {
    if (!std::isfinite(elements.measures[f]) || elements.measures[f] <= 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("triangle ", f, " has no area; remove it or remesh the surface"));
    }
  }
  return absl::OkStatus();
}

// What a mesh preparation is to tets.
struct PreparedSurface {
  PreparedSurface(const TriangleMesh& mesh, Eigen::VectorXd surface_stiffness,
                  ConstraintSet constraint_set, int threads)
      : elements(ElementsOf(mesh, threads)),
        vertex_cells(elements.cells, elements.num_vertices()),
        stiffness(std::move(surface_stiffness)),
        constraints(std::move(constraint_set)) {}

  int64_t bytes_held() const {
    const Eigen::Index doubles =
        stiffness.size() + elements.measures.size() + elements.normals.size();
    return laplacian->bytes_held() + vertex_cells.bytes_held() +
           doubles * static_cast<int64_t>(sizeof(double));
  }

  PiecewiseLinearElements elements;
  VertexCells vertex_cells;
  Eigen::VectorXd stiffness;
  ConstraintSet constraints;
  std::unique_ptr<PreparedLaplacian> laplacian;
};

absl::StatusOr<std::unique_ptr<Deformer>> CreateFromParts(SharedParts parts,
                                                          const GradientFieldOptions& options,
                                                          const Cancellation& cancellation) {
  auto deformer = std::make_unique<GradientFieldDeformer>(std::move(parts), options);
  TF_RETURN_IF_ERROR(deformer->Prepare(cancellation));
  return deformer;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Deformer>> CreateGradientFieldDeformer(
    const TetMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
    const GradientFieldOptions& options) {
  TF_RETURN_IF_ERROR(CheckIteration(options.max_iterations, options.tolerance_mm));
  PreparationOptions preparation_options;
  preparation_options.backend = options.backend;
  preparation_options.admission = options.admission;
  preparation_options.threads = options.threads;
  TF_ASSIGN_OR_RETURN(auto preparation, MeshPreparation::Create(mesh, stiffness, constraints,
                                                                std::move(preparation_options)));
  return CreateGradientFieldDeformer(std::move(preparation), options);
}

absl::StatusOr<std::unique_ptr<Deformer>> CreateGradientFieldDeformer(
    std::shared_ptr<MeshPreparation> preparation, const GradientFieldOptions& options,
    const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckIteration(options.max_iterations, options.tolerance_mm));
  TF_ASSIGN_OR_RETURN(PreparedLaplacian * laplacian, preparation->Laplacian(cancellation));
  const MeshPreparation& shared = *preparation;
  return CreateFromParts(
      {std::move(preparation), shared.elements(), shared.vertex_cells(), shared.stiffness(),
       shared.constraints(), laplacian, shared.laplacian_bytes()},
      options, cancellation);
}

absl::StatusOr<std::unique_ptr<Deformer>> CreateSurfaceGradientFieldDeformer(
    const TriangleMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
    const GradientFieldOptions& options) {
  TF_RETURN_IF_ERROR(CheckIteration(options.max_iterations, options.tolerance_mm));
  TF_RETURN_IF_ERROR(CheckStiffness(mesh.num_triangles(), stiffness, "triangle"));
  TF_RETURN_IF_ERROR(
      CheckEveryComponentConstrained(mesh.triangles(), mesh.num_vertices(), constraints));
  const Stopwatch stopwatch;
  auto surface = std::make_shared<PreparedSurface>(mesh, stiffness, constraints, options.threads);
  TF_RETURN_IF_ERROR(CheckAreas(surface->elements));
  const SparseMatrix L = CotangentLaplacian(mesh, stiffness, options.threads);
  const double assemble_seconds = stopwatch.Seconds();
  TF_ASSIGN_OR_RETURN(surface->laplacian,
                      PrepareLaplacian(L, constraints, {options.backend, options.admission}));
  surface->laplacian->assemble_seconds = assemble_seconds;
  return CreateFromParts({surface, surface->elements, surface->vertex_cells, surface->stiffness,
                          surface->constraints, surface->laplacian.get(), surface->bytes_held()},
                         options, {});
}

}  // namespace tissueform
