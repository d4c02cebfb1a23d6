// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"

namespace tissueform {

// Why an iteration ended.
enum class Termination {
  kConverged,   // it has converged, or was cancelled
  kIterations,  // as many as the options allow
  kNoRoom,      // the memory for a second factor, which it needs, was refused
  kArithmetic,  // no step makes it better: rounding is all that is left
  kBlocked,     // parts of the body would have to pass through each other
};

// "iterations", "no_room", "arithmetic", "blocked"; empty for kConverged.
absl::string_view TerminationName(Termination gave_up);

// How an answer was found. A tolerance that was not reached is reported here; it is not an error.
struct SolveSummary {
  int iterations = 1;    // linear solves
  int newton_steps = 0;  // of them those with a new factor
  bool converged = true;
  bool cancelled = false;  // stopped by DeformControl::on_progress
  double residual = 0;     // relative residual of the last linear solve; 0 unless asked for
  double solve_seconds = 0;
  std::vector<double>
      changes_mm;  // largest vertex change of each iteration; empty for direct models
  // Of the answer after each iteration, in nJ = Pa mm^3; empty for models that minimise none.
  std::vector<double> energies_nj;
  // Share of the poses' motion that was reached; below 1 when a model that loads in steps came no
  // further.
  double load = 1;
  Termination gave_up = Termination::kConverged;
  // What stands in the way, a sentence without its full stop that names handles; empty where
  // nothing does.
  std::string obstacle;
  int64_t second_factor_bytes = 0;  // held only during the search
  // Found by prepared answers (VertexResponse), and how far it may then lie from the direct one.
  bool prepared = false;
  double error_bound_mm = 0;
  // The same for models whose error has no known bound: an estimate, and error_bound_mm is 0.
  double error_estimate_mm = 0;
};

// Of the unilateral contact rows, in the order of the constraint set; empty without any.
struct ContactAnswer {
  // Pa mm^2, at least 0. Of gradient_field and arap they show where contact is, not how strong.
  std::vector<double> forces;
  std::vector<double> gaps_mm;  // at least 0 within the residual
  // How far the answer misses the conditions of contact at most (LcpSolution::kkt_residual_mm).
  double residual_mm = 0;
};

// Of lips that were asked to be sealed.
struct SealAnswer {
  int64_t pairs = 0;
  // How far the edges are parted along `up` at most before they are sealed.
  double parted_mm = 0;
  bool released = false;  // that is too far for a seal: the answer is the one without it

  friend bool operator==(const SealAnswer&, const SealAnswer&) = default;
};

struct Deformation {
  Positions positions;  // #V by 3, mm
  SolveSummary summary;
  ContactAnswer contact = {};
  std::optional<SealAnswer> seal = {};
};

// How an answer is sought, for models that iterate.
struct DeformControl {
  // Start from where the last answer ended instead of from rest: for a stream of poses close to
  // each other. Within the tolerance the answer is the same.
  bool warm_start = false;
  // Called with every answer but the last; returning false stops with that answer, marked as
  // cancelled.
  std::function<bool(const Deformation& so_far)> on_progress;
  // May be empty. Asked, with the bytes, before an answer takes room for another factor, which it
  // gives back at its end; an error leaves the search without that factor.
  FactorAdmission admission = {};
};

// What preparing a deformer took and what it holds.
struct PreparationSummary {
  double assemble_seconds = 0;
  double analyse_seconds = 0;
  double factorise_seconds = 0;
  double prepare_seconds = 0;  // harmonic fields and everything else that a model makes ready
  int64_t factor_bytes = 0;
  int64_t bytes_held = 0;  // everything that the deformer needs, shared parts included
  int64_t own_bytes = 0;   // of it what it holds beside the shared preparation
  Eigen::Index negative_weights = 0;
  double harmonic_min = 0;  // range of the harmonic fields; [0, 1] unless weights are negative
  double harmonic_max = 1;
};

// A model of soft tissue, prepared for one mesh, one stiffness and one constraint set: there is no
// unprepared state. A new pose never factorises again. One thread at a time.
class Deformer {
 public:
  virtual ~Deformer() = default;

  // `poses` has one entry per handle of the constraint set, in its order.
  //
  // Errors: InvalidArgument when the number of poses is wrong or a pose is not legal (see
  // CheckPose).
  virtual absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                             const DeformControl& control) = 0;
  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses) {
    return Deform(poses, DeformControl{});
  }

  virtual const PreparationSummary& preparation() const = 0;
};

}  // namespace tissueform
