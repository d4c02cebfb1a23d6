// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"

namespace tissueform {

struct NeoHookeanOptions {
  int max_iterations = 1000;  // back-substitutions for one answer, all load steps together
  // On the norm of the elastic forces on the free vertices, which vanish in equilibrium, over that
  // of the forces that the constrained vertices bear. (To the latter is added what a strain of 1e-6
  // all over would bring, so that the rest shape, where all forces vanish, counts as reached.)
  // Displacements are then right to some 1e-5 of the largest.
  double tolerance = 1e-4;
  int history = 8;  // pairs of the L-BFGS iteration
  // Iterations in which the residual has not halved, after which Newton steps come in (or eight
  // times as many altogether); 0: they do from the beginning. Of the searches that were tried,
  // those that L-BFGS alone brings to the tolerance in some 350 iterations never wait for 60;
  // searches that take longer without Newton steps, or never end, are shortened by them.
  int newton_after = 60;
  int newton_blas_threads = 1;  // for their factors, see BlasThreadsScope; 1 in a server
};

// The equilibrium of a compressible neo-Hookean body (see NeoHookeanEnergy) with the constrained
// vertices where the poses put them: found by L-BFGS with the factorised linear stiffness as first
// inverse Hessian (Liu, Bouaziz, Kavan 2017), starting from the linear answer.
//
// Where the residual stops falling (tissue that turns far or is strained much: thin limbs, thin
// layers between thick handles) Newton steps with the energy's own tangent take over: see
// NewtonFallback, and DeformControl::admission for the memory.
//
// Where that is no start (it inverts tets, or a handle turns by more than 30 degrees, which may be
// a full twist that the linear model cannot distinguish from rest) the poses are approached in load
// steps, halved where a step would invert a tet. All tets of an answer are positive. Poses that
// cannot be reached so (a handle pushed through fixed tissue), or not within the iterations, give
// the state that was: SolveSummary reports its `load`, `residual`, that it has not `converged`, why
// it `gave_up` and which regions stand in each other's way.
//
// Contact rows hold as in TurningContact: the normals of a handle's bone turn with it. The search
// begins with the rows that touch in the linear answer and keeps them closed; where an equilibrium
// is nearly found, rows that pull are opened and rows that penetrate closed, until none does so by
// more than 0.001 mm. Bilateral rows hold to rounding in every state. Newton steps are not taken
// with contact: what L-BFGS does not find is not found.
//
// A warm start walks from the poses of the last answer to the new ones; where it gets stuck the
// walk begins again from rest.
//
// Errors: InvalidArgument (an option out of range), those of MeshPreparation::Elastic and Contact
// and of TurningContact::Create, or what the admission says.
absl::StatusOr<std::unique_ptr<Deformer>> CreateNeoHookeanDeformer(
    std::shared_ptr<MeshPreparation> preparation, const NeoHookeanOptions& options,
    const Cancellation& cancellation = {});

}  // namespace tissueform
