// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <limits>
#include <memory>

#include "absl/status/status.h"

#include "core/mechanics/deformation/equilibrium_search.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/elasticity/neo_hookean_tangent.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"

namespace tissueform {

// Watches the residual of a search and says when it has stopped falling: it has not halved within
// `patience` iterations.
class StagnationDetector {
 public:
  explicit StagnationDetector(int patience) : patience_(patience) {}

  // Starts again: at another state, or with another patience.
  void Restart(int patience) { *this = StagnationDetector(patience); }

  // Call it with the residual before every iteration.
  bool HasStalled(double residual) {
    if (residual <= 0.5 * mark_) {
      mark_ = residual;
      waited_ = 0;
    }
    return waited_++ >= patience_;
  }

 private:
  int patience_;
  double mark_ = std::numeric_limits<double>::infinity();
  int waited_ = 0;
};

// Takes a neo-Hookean search on by Newton steps where the linear stiffness of the rest shape no
// longer leads it: where the residual has stopped falling, as in tissue that has turned far (thin
// limbs) or is strained much. The tangent at the state is factorised and becomes the first inverse
// Hessian of the search, so that its next step is Newton's. Steps that follow keep that factor as
// long as the residual goes on falling, and Newton's comes again when it does not.
//
// The factor lies beside the elastic one, in the same order of unknowns, so there is nothing to
// look for and it is as large. It goes at the end of an answer. One thread at a time.
class NewtonFallback {
 public:
  static constexpr int kMaxPatiences = 8;

  // All must outlive it. `elastic` is of `preparation`. `patience`: iterations in which the
  // residual has not halved before the first Newton step. `blas_threads` factorise.
  NewtonFallback(const MeshPreparation* preparation, const ElasticSystem* elastic,
                 EquilibriumSearch* search, int patience, int blas_threads)
      : preparation_(*preparation),
        elastic_(*elastic),
        search_(*search),
        patience_(patience),
        blas_threads_(blas_threads) {}

  // Before an answer. `admission`, which may be empty, is asked for bytes_needed() before the
  // factor is made.
  void Begin(FactorAdmission admission);
  // After it: the search is as before.
  void End();

  // At another load, whose residual need not be smaller.
  void Restart();

  // To be called before every step of the search: makes it Newton's when the residual has stopped
  // falling, or when the answer has taken kMaxPatiences as many `iterations` and still had none.
  // True when it did.
  bool Consider(int iterations);
  // Makes the next step Newton's. False where that cannot be: no room, or tissue so crushed that
  // not even the positive tangent can be factorised.
  bool Take();

  // Whether the admission refused the factor of this answer.
  bool had_no_room() const { return had_no_room_; }
  int64_t bytes_needed() const;

 private:
  absl::Status Factorise(TangentForm form);
  absl::Status FactoriseBest();

  const MeshPreparation& preparation_;
  const ElasticSystem& elastic_;
  EquilibriumSearch& search_;
  const int patience_;
  const int blas_threads_;

  // Of one answer.
  FactorAdmission admission_;
  StagnationDetector watch_{0};
  bool is_possible_ = true;
  bool had_no_room_ = false;
  std::unique_ptr<DirichletSystem> system_;  // null without a Newton step
};

}  // namespace tissueform
