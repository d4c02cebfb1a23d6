// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/cancellation.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"

namespace tissueform {

// Linear elasticity on constant-strain tets: K d = 0 at the free vertices, with the constrained
// ones exactly where the poses put them, also by a large rotation (the interior answers linearly to
// it, so tissue near a handle that turns far is blown up: see NeoHookeanDeformer). An answer is a
// small dense product with the prepared columns of ElasticSystem, without a back-substitution.
//
// Errors: those of MeshPreparation::Elastic.
absl::StatusOr<std::unique_ptr<Deformer>> CreateLinearElasticDeformer(
    std::shared_ptr<MeshPreparation> preparation, const Cancellation& cancellation = {});

// The same answer by back-substitution with the prescribed displacements, which the columns are
// checked against and compared with in speed. The residual is that of the linear system.
//
// Errors: those of Deformer::Deform and of MeshPreparation::Elastic.
absl::StatusOr<Deformation> SolveLinearElasticDirectly(MeshPreparation* preparation,
                                                       absl::Span<const HandlePose> poses);

}  // namespace tissueform
