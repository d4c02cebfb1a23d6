// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/newton_fallback.h"

#include <optional>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/mechanics/linear_solvers/blas_threads.h"

namespace tissueform {
namespace {

// Iterations with the factor of a tangent in which the residual has not halved before the next
// Newton step. A factor costs some twenty back-substitutions with what goes with them. Measured on
// bars that are bent by 60 degrees and shortened: a Newton step at every iteration took 64 factors
// in 170 iterations, a patience of 8 takes 10 in 209 and half the time, one of 30 takes 5 in 305.
constexpr int kPatience = 8;

}  // namespace

void NewtonFallback::Begin(FactorAdmission admission) {
  admission_ = std::move(admission);
  is_possible_ = true;
  had_no_room_ = false;
  Restart();
}

void NewtonFallback::End() {
  search_.PreconditionBy(nullptr);
  system_.reset();
  admission_ = {};
}

void NewtonFallback::Restart() { watch_.Restart(system_ != nullptr ? kPatience : patience_); }

bool NewtonFallback::Consider(int iterations) {
  // A way of many load steps may take an age without stalling at any of them.
  const bool is_late =
      system_ == nullptr && iterations >= int64_t{kMaxPatiences} * int64_t{patience_};
  return (watch_.HasStalled(search_.residual()) || is_late) && Take();
}

bool NewtonFallback::Take() {
  if (!is_possible_) {
    return false;
  }
  if (const absl::Status status = FactoriseBest(); !status.ok()) {
    had_no_room_ = absl::IsResourceExhausted(status);
    is_possible_ = false;
    system_.reset();
    search_.PreconditionBy(nullptr);
    return false;
  }
  search_.PreconditionBy(system_.get());
  watch_.Restart(kPatience);
  // This state counts as seen: the step that follows is the first of the patience.
  watch_.HasStalled(search_.residual());
  return true;
}

absl::Status NewtonFallback::FactoriseBest() {
  if (system_ == nullptr && admission_) {
    TF_RETURN_IF_ERROR(admission_(bytes_needed()));
  }
  // Near a stable equilibrium the true tangent is positive definite, and its steps converge
  // quadratically; the positive one, which is stiffer wherever a tet is compressed, would only
  // creep. Farther away it often is not, and its factorisation would be lost. That a whole step was
  // taken last is the sign that the energy is here what its second derivatives say.
  const bool trusts_derivatives = system_ != nullptr && search_.step_length() == 1.0;
  if (trusts_derivatives && Factorise(TangentForm::kTrue).ok()) {
    return absl::OkStatus();
  }
  return Factorise(TangentForm::kPositive);
}

absl::Status NewtonFallback::Factorise(TangentForm form) {
  const SparseMatrix tangent =
      NeoHookeanTangent(preparation_.elements(), preparation_.vertex_cells(),
                        preparation_.stiffness(), preparation_.options().poisson_ratio,
                        search_.displacements(), form, preparation_.options().threads);
  std::optional<BlasThreadsScope> factorising;  // not at all in a server: see there
  if (blas_threads_ > 1) factorising.emplace(blas_threads_);
  if (system_ != nullptr) {
    return system_->Refactorize(tangent);
  }
  std::vector<int32_t> prescribed;
  prescribed.reserve(3 * preparation_.constraints().constrained().size());
  for (const int32_t vertex : preparation_.constraints().constrained()) {
    for (int axis = 0; axis < 3; ++axis) {
      prescribed.push_back(3 * vertex + axis);
    }
  }
  TF_ASSIGN_OR_RETURN(system_, DirichletSystem::Create(tangent, prescribed,
                                                       {.backend = preparation_.options().backend,
                                                        .admission = {},
                                                        .unknowns_per_node = 3,
                                                        .node_order = preparation_.node_order()}));
  return absl::OkStatus();
}

int64_t NewtonFallback::bytes_needed() const {
  // The matrix itself comes on top while its blocks are taken out of it: it is about twice the
  // lower triangle that the elastic system keeps beside its factor.
  const int64_t system = elastic_.system().bytes_held();
  const int64_t beside_factor = system - elastic_.system().factorization().factor_bytes;
  return system + 2 * beside_factor +
         NeoHookeanTangentWorkspaceBytes(preparation_.mesh().num_tets());
}

}  // namespace tissueform
