// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/cancellation.h"
#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/deformation/model.h"
#include "core/mechanics/uncertainty/material_uncertainty.h"

namespace tissueform {

// How an elastic answer changes with what is not known, as a polynomial in independent standard
// normal variables z. Of its material: one variable a tissue, its stiffness being multiplied by
// exp(sigma z) with sigma = log(factor_95) / kNormal95, and then one for Poisson's ratio where that
// is uncertain; all is zero at constrained vertices. Of surgery: surgery_expansion.h.
struct AnswerExpansion {
  static constexpr int kNone = -1;
  // The displacement `field` times z_first, or times z_first z_second.
  struct Term {
    int first = 0;
    int second = kNone;
    Eigen::MatrixXd field;  // 3 #V (unknown 3 v + axis) by #columns of what was expanded, mm
  };
  int variables = 0;
  std::vector<Term> terms;
};

enum class ExpansionOrder { kFirst, kSecond };

// Of linear elasticity, of every column of `displacements` (3 #V by k): equilibria, by
//   K s_i = -sigma_i K_i u,   K t_ij = -(sigma_i K_i s_j + sigma_j K_j s_i),
//   K t_ii = -(sigma_i K_i s_i + sigma_i^2 / 2 K_i u),
// K_i the part of K that tissue i adds. Poisson's ratio, of which K is no linear function: through
// the equilibria at both ends of its range (two factors more, one at a time), a parabola in its
// variable, or with kFirst their mean slope. Products of its variable with others are left out.
//
// With contact, `held` are the directions that hold the answer (HeldDirections) and stay as they
// are: the expansion is that of the answer while no other row opens or closes. Null without
// contact.
//
// Errors: those of MeshPreparation::Elastic and of DirichletSystem; InvalidArgument where there are
// contact rows and `held` is null.
absl::StatusOr<AnswerExpansion> ExpandLinearElastic(MeshPreparation* preparation,
                                                    const MaterialUncertainty& uncertainty,
                                                    const Eigen::MatrixXd& displacements,
                                                    ExpansionOrder order,
                                                    const Cancellation& cancellation = {},
                                                    const SparseMatrix* held = nullptr);

// Of a neo-Hookean equilibrium `deformed` (#V by 3, mm; every tet positive): the same with the
// tangent of the energy there in place of K, the forces that tissue i exerts there in place of K_i
// u, and a Newton step from there at the ends of the range of Poisson's ratio. Exact in first
// order; in second order the third derivatives of the energy are left out.
//
// Errors: FailedPrecondition where the tangent is not positive definite (`deformed` is no stable
// equilibrium), ResourceExhausted, or what the preparation's admission says; Cancelled;
// InvalidArgument as above.
absl::StatusOr<AnswerExpansion> ExpandNeoHookean(MeshPreparation* preparation,
                                                 const MaterialUncertainty& uncertainty,
                                                 const Positions& deformed, ExpansionOrder order,
                                                 const Cancellation& cancellation = {},
                                                 const SparseMatrix* held = nullptr);

// Of an answer of one of these two models, with its contact: `deformed` (#V by 3, mm) under
// `poses`, one a handle. Errors: those of the two; InvalidArgument for another model.
absl::StatusOr<AnswerExpansion> ExpandAnswer(MeshPreparation* preparation, DeformationModel model,
                                             const MaterialUncertainty& uncertainty,
                                             absl::Span<const HandlePose> poses,
                                             const Positions& deformed, ExpansionOrder order,
                                             const Cancellation& cancellation = {});

}  // namespace tissueform
