// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/cancellation.h"
#include "core/mechanics/constraints/lip_edge.h"
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

// Lips whose edges differ by more than this along LipEdge::up are not sealed: the mouth is open.
// Operations move the jaws by up to about 10 mm against each other (docs/lips.md).
inline constexpr double kSealReleaseMm = 12;

// The same model with a one-way lip seal: posture, not mechanics. It solves with the lips free,
// takes the heights of the upper lip's edge from there, prescribes them to the lower lip's edge and
// solves again. Deformation::seal says whether the lips were released. Each answer costs two
// back-substitutions.
//
// Errors: those of CheckLipEdge, LipSeal::Create and CreateLinearElasticDeformer.
absl::StatusOr<std::unique_ptr<Deformer>> CreateSealedLipsDeformer(
    std::shared_ptr<MeshPreparation> preparation, const LipEdge& edge,
    const Cancellation& cancellation = {});

// The same answer as CreateLinearElasticDeformer by back-substitution with the prescribed
// displacements, which the columns are checked against and compared with in speed. The residual is
// that of the linear system.
//
// Errors: those of Deformer::Deform and of MeshPreparation::Elastic.
absl::StatusOr<Deformation> SolveLinearElasticDirectly(MeshPreparation* preparation,
                                                       absl::Span<const HandlePose> poses);

}  // namespace tissueform
