// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/deformation/elastic_contact.h"
#include "core/mechanics/deformation/elastic_system.h"
#include "core/mechanics/deformation/laplacian_contact.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

struct PreparationOptions {
  double poisson_ratio = 0.45;  // of the elastic models, in [0, 0.5)
  CholeskyBackend backend = CholeskyBackend::kCholmod;
  // May be empty. Called before anything large is allocated (each factor, the elastic response
  // columns, a response basis) with the bytes that come on top; an error stops that preparation.
  FactorAdmission admission;
  int threads = 1;  // answers do not depend on it
  // The caller has found the mesh usable (CheckTetMesh): it is not asked
  // again.
  bool mesh_is_usable = false;
  PreparationObserver observer = nullptr;  // of Laplacian and Elastic; may be empty
  // A permutation of the vertices from an earlier preparation, see MeshPreparation::node_order;
  // empty, or of another mesh's length: one is looked for.
  std::vector<int32_t> node_order = {};
};

// The Laplacian of the mesh with the constrained vertices eliminated, and what is solved with it at
// once.
struct PreparedLaplacian {
  std::unique_ptr<DirichletSystem> system;
  Eigen::MatrixXd harmonic;  // #V by #handles
  std::unique_ptr<LaplacianContact> contact;
  double assemble_seconds = 0;
  double harmonic_seconds = 0;
  Eigen::Index negative_weights = 0;

  int64_t bytes_held() const;
};

// Factorises L, computes the harmonic fields and condenses the contact rows; assemble_seconds is
// left to the caller, who made L. Harmonic fields of tissue that slides take a second factor, which
// is given back at once. Errors: FailedPrecondition (not positive definite), ResourceExhausted,
// Cancelled, those of LaplacianContact::Create, or what the admission says.
absl::StatusOr<std::unique_ptr<PreparedLaplacian>> PrepareLaplacian(
    const SparseMatrix& L, const ConstraintSet& constraints,
    const DirichletSystem::Options& options, const Cancellation& cancellation = {});

// What the models on one mesh, one stiffness and one constraint set share: operators, orderings and
// factors. Each is made when a model first asks for it and never again, so switching the model does
// not factorise what exists. Held by every deformer made from it. Made by one thread at a time; the
// finished parts are constant, and deformers on several threads may use them concurrently.
class MeshPreparation {
 public:
  // Checks, and factorises nothing yet. `stiffness` is Young's modulus per tet in Pa, #T.
  //
  // Errors: InvalidArgument (a mesh that is not usable, stiffness not positive or of the wrong
  // length, a connected component without constraint, a contact row at a vertex that no tet holds,
  // a Poisson's ratio outside [0, 0.5)).
  static absl::StatusOr<std::shared_ptr<MeshPreparation>> Create(const TetMesh& mesh,
                                                                 const Eigen::VectorXd& stiffness,
                                                                 const ConstraintSet& constraints,
                                                                 PreparationOptions options);

  const TetMesh& mesh() const { return mesh_; }
  const Eigen::VectorXd& stiffness() const { return stiffness_; }
  const ConstraintSet& constraints() const { return constraints_; }
  const PreparationOptions& options() const { return options_; }
  const PiecewiseLinearElements& elements() const { return elements_; }  // measures: volumes
  const VertexCells& vertex_cells() const { return vertex_cells_; }

  // Errors: FailedPrecondition (not positive definite), ResourceExhausted, Cancelled, or what the
  // admission says. After an error the call may be repeated. The pointers live as long as the
  // preparation.
  absl::StatusOr<PreparedLaplacian*> Laplacian(const Cancellation& cancellation = {});
  absl::StatusOr<ElasticSystem*> Elastic(const Cancellation& cancellation = {});
  // Errors: those of Elastic and ElasticContact::Create.
  absl::StatusOr<const ElasticContact*> Contact(const Cancellation& cancellation = {});

  bool has_laplacian() const { return laplacian_ != nullptr; }
  bool has_elastic() const { return elastic_ != nullptr; }

  // The fill-reducing order of the vertices that all factors use, known with the first of them:
  // kept, it makes the same factors again without being looked for. Empty where the backend keeps
  // none.
  const std::vector<int32_t>& node_order() const { return node_order_; }

  // Everything made so far; the mesh is not counted.
  int64_t bytes_held() const;
  // Of it what the models on the Laplacian need: all but the elastic system.
  int64_t laplacian_bytes() const;

 private:
  MeshPreparation(const TetMesh& mesh, Eigen::VectorXd stiffness, ConstraintSet constraints,
                  PreparationOptions options);

  // Constant after Create.
  const TetMesh mesh_;
  const Eigen::VectorXd stiffness_;
  const ConstraintSet constraints_;
  const PreparationOptions options_;
  const PiecewiseLinearElements elements_;
  const VertexCells vertex_cells_;

  // Null until asked for.
  std::unique_ptr<PreparedLaplacian> laplacian_;
  std::unique_ptr<ElasticSystem> elastic_;
  std::unique_ptr<ElasticContact> contact_;  // uses elastic_

  std::vector<int32_t> node_order_;
};

}  // namespace tissueform
