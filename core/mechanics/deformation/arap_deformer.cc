// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/arap_deformer.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mechanics/deformation/anderson_acceleration.h"
#include "core/mechanics/deformation/contact_reconstruction.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/handle_targets.h"
#include "core/mechanics/deformation/poisson_reconstruction.h"
#include "core/mechanics/deformation/rotation_fit.h"
#include "core/mechanics/deformation/rotation_propagation.h"

namespace tissueform {
namespace {

// By which rounding alone makes the closed gaps of an extrapolated iterate negative.
constexpr double kLargestPenetration = 1e-9;  // mm

class ArapDeformer : public Deformer {
 public:
  ArapDeformer(std::shared_ptr<MeshPreparation> preparation, const PreparedLaplacian& laplacian,
               const ArapOptions& options)
      : shared_(std::move(preparation)),
        elements_(shared_->elements()),
        laplacian_(laplacian),
        options_(options),
        reconstruction_(laplacian) {
    const FactorizationSummary& factorization = laplacian.system->factorization();
    preparation_.assemble_seconds = laplacian.assemble_seconds;
    preparation_.analyse_seconds = factorization.analyse_seconds;
    preparation_.factorise_seconds = factorization.factorise_seconds;
    preparation_.prepare_seconds = laplacian.harmonic_seconds;
    preparation_.factor_bytes = factorization.factor_bytes;
    preparation_.own_bytes = elements_.num_cells() * CellTransforms::ColsAtCompileTime *
                             static_cast<int64_t>(sizeof(double));
    preparation_.bytes_held = shared_->laplacian_bytes() + preparation_.own_bytes;
    preparation_.negative_weights = laplacian.negative_weights;
    preparation_.harmonic_min = laplacian.harmonic.minCoeff();
    preparation_.harmonic_max = laplacian.harmonic.maxCoeff();
  }

  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                     const DeformControl& control) override {
    TF_RETURN_IF_ERROR(CheckPoses(shared_->constraints(), poses));
    const Stopwatch stopwatch;
    const HandleTargets targets = MakeHandleTargets(shared_->constraints(), elements_.rest, poses);
    TF_ASSIGN_OR_RETURN(State state, Start(poses, targets, control.warm_start));
    AndersonAcceleration acceleration(options_.acceleration_depth);
    Deformation deformation;
    SolveSummary& summary = deformation.summary;
    summary.iterations = state.solves;
    summary.energies_nj.push_back(state.energy);
    summary.converged = false;
    bool stuck = false;
    const auto report = [&] {
      summary.solve_seconds = stopwatch.Seconds();
      const bool last = summary.converged || stuck || summary.iterations >= options_.max_iterations;
      if (last || control.on_progress) {
        deformation.positions =
            ToPositions(shared_->constraints(), elements_.rest, state.displacements, targets);
        deformation.contact = reconstruction_.Describe(state.displacements, state.forces, targets);
      }
      summary.cancelled = !last && control.on_progress && !control.on_progress(deformation);
      return last || summary.cancelled;
    };
    while (!report()) {
      TF_ASSIGN_OR_RETURN(const ContactReconstruction::Answer image, Reconstruct(targets));
      ++summary.iterations;
      summary.changes_mm.push_back(
          (image.displacements - state.displacements).rowwise().norm().maxCoeff());
      summary.converged = image.converged && summary.changes_mm.back() <= options_.tolerance_mm;
      state.forces = image.forces;
      const Eigen::MatrixXd accelerated =
          acceleration.Next(state.displacements, image.displacements);
      // Two trials: the extrapolated iterate may raise the energy, the plain image cannot but for
      // rounding (both halves of the step minimise the same energy). When even that rises, the
      // arithmetic has nothing more to give. A converged iterate is not extrapolated from, and an
      // extrapolated one may not penetrate: with less energy than any answer it would stay for
      // good.
      const bool extrapolates =
          !summary.converged &&
          reconstruction_.SmallestGap(accelerated, targets) >= -kLargestPenetration;
      stuck =
          !(extrapolates && Accept(accelerated, &state)) && !Accept(image.displacements, &state);
      summary.energies_nj.push_back(state.energy);
    }
    return deformation;
  }

  const PreparationSummary& preparation() const override { return preparation_; }

 private:
  // An iterate; loads_ belongs to it.
  struct State {
    Eigen::MatrixXd displacements;  // #V by 3
    Eigen::VectorXd forces;         // of contact, from the last solve
    double energy = 0;
    int solves = 1;
  };

  // Energy of displacements; loads_ becomes that of their closest rotations.
  double Fit(const Eigen::MatrixXd& displacements) {
    const int threads = shared_->options().threads;
    const double energy =
        FitRotations(elements_, shared_->stiffness(), displacements, threads, &loads_);
    TransformsToCornerLoads(elements_, shared_->stiffness(), threads, &loads_);
    return energy;
  }

  // Moves on to `next` unless its energy is higher.
  bool Accept(const Eigen::MatrixXd& next, State* state) {
    const double energy = Fit(next);
    if (!(energy <= state->energy)) {
      return false;
    }
    state->displacements = next;
    state->energy = energy;
    return true;
  }

  absl::StatusOr<ContactReconstruction::Answer> Reconstruct(const HandleTargets& targets) {
    Eigen::MatrixXd rhs = GatherCornerLoads(shared_->vertex_cells(), elements_.num_vertices(),
                                            loads_, shared_->options().threads);
    return reconstruction_.Solve(targets, &rhs);
  }

  absl::StatusOr<State> Start(absl::Span<const HandlePose> poses, const HandleTargets& targets,
                              bool warm) {
    // The better of two begins: the last answer's rotations under the new poses, which are near
    // while a handle is dragged, or the propagated ones, which are near after a jump. The energy
    // decides, for one more solve. Fit at the end: loads_ must belong to the state that is kept.
    ContactReconstruction::Answer last;
    const bool has_last = warm && loads_.rows() > 0 && options_.max_iterations > 1;
    if (has_last) {
      TF_ASSIGN_OR_RETURN(last, Reconstruct(targets));
    }
    const int threads = shared_->options().threads;
    PropagateRotations(elements_, laplacian_.harmonic, poses, threads, &loads_);
    TransformsToCornerLoads(elements_, shared_->stiffness(), threads, &loads_);
    TF_ASSIGN_OR_RETURN(ContactReconstruction::Answer first, Reconstruct(targets));
    State state{.displacements = std::move(first.displacements), .forces = std::move(first.forces)};
    state.energy = Fit(state.displacements);
    if (has_last) {
      state.solves = 2;
      if (Accept(last.displacements, &state)) {
        state.forces = last.forces;
      } else {
        Fit(state.displacements);
      }
    }
    return state;
  }

  // Constant.
  const std::shared_ptr<MeshPreparation> shared_;
  const PiecewiseLinearElements& elements_;
  const PreparedLaplacian& laplacian_;
  const ArapOptions options_;
  PreparationSummary preparation_;

  ContactReconstruction reconstruction_;  // holds workspaces
  // Of the last iterate's closest rotations: what the next step, and a warm start, begins with. No
  // rows before the first pose.
  CornerLoads loads_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Deformer>> CreateArapDeformer(
    std::shared_ptr<MeshPreparation> preparation, const ArapOptions& options,
    const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckIteration(options.max_iterations, options.tolerance_mm));
  if (options.acceleration_depth < 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "acceleration_depth is ", options.acceleration_depth, "; it must not be negative"));
  }
  TF_ASSIGN_OR_RETURN(const PreparedLaplacian* laplacian, preparation->Laplacian(cancellation));
  return std::make_unique<ArapDeformer>(std::move(preparation), *laplacian, options);
}

}  // namespace tissueform
