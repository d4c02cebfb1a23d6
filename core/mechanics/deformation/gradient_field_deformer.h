// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/deformation/rotation_estimation.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// Where the rotation of each cell comes from.
enum class RotationMode {
  kPropagated,  // blended from the handles along the harmonic fields (Liao et al. 2009,
                // section 3.2)
  kEstimated,   // found by iteration from the answer itself: for handles that only translate (Figs.
                // 2 to 4)
  kNone,        // identity everywhere: plain Poisson (Eq. 6), for comparison
};

// Which Laplacian the harmonic fields obey. The reconstruction always uses the cotangent one.
enum class Guidance {
  kCotangent,
  kUniform,  // one on every edge: the source's counter-example (Fig. 6b and d); costs a second
             // factor
};

struct GradientFieldOptions {
  RotationMode rotation = RotationMode::kPropagated;
  Guidance guidance = Guidance::kCotangent;

  // For kEstimated only.
  BlendMap blend = BlendMap::kCosine;
  int max_iterations = 30;      // linear solves, the first plain one among them
  double tolerance_mm = 0.001;  // on the largest change of a vertex in one iteration
  int acceleration_depth = 5;   // of Anderson's acceleration; 0 iterates plainly

  CholeskyBackend backend = CholeskyBackend::kCholmod;
  FactorAdmission admission;      // may be empty; called once for each factor
  bool compute_residual = false;  // costs one product with the system matrix per answer
  int threads = 1;                // answers do not depend on it
};

// Gradient-field deformation (Liao et al. 2009): harmonic fields spread the handles' rotations and
// scales over the cells, a Poisson equation stitches the turned cells together. Harmonic fields and
// reconstruction share one factor.
//
// Contact rows hold in the reconstruction, which then fits the turned cells best among the
// positions that meet them (LaplacianContact). Where tissue slides on a bone its cells turn with
// the bone (GuidedVertices).
//
// `stiffness` is Young's modulus per cell in Pa, one positive number each. Keeps nothing of its
// arguments.
//
// Errors: InvalidArgument (a mesh that is not usable, stiffness not positive or of the wrong
// length, a connected component without constraint, an option out of range), ResourceExhausted, or
// what the admission says.
absl::StatusOr<std::unique_ptr<Deformer>> CreateGradientFieldDeformer(
    const TetMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
    const GradientFieldOptions& options);

// The same, sharing the operators, the factor and the harmonic fields of a preparation with other
// models. `options.backend`, `admission` and `threads` are those of the preparation; only the
// second factor of uniform guidance asks options.admission.
absl::StatusOr<std::unique_ptr<Deformer>> CreateGradientFieldDeformer(
    std::shared_ptr<MeshPreparation> preparation, const GradientFieldOptions& options,
    const Cancellation& cancellation = {});

// The same on a surface with the cotangent weights of Eq. 13: what the source compares volumes with
// (Figs. 1b, 2e to h, 5c). The surface may be open; triangles without area are refused.
absl::StatusOr<std::unique_ptr<Deformer>> CreateSurfaceGradientFieldDeformer(
    const TriangleMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
    const GradientFieldOptions& options);

}  // namespace tissueform
