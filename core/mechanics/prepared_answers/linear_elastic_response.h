// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/preparation_progress.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/column_compression.h"
#include "core/mechanics/prepared_answers/vertex_response.h"

namespace tissueform {

struct LinearElasticResponseOptions {
  double tolerance_mm = 0.01;  // of any chosen vertex against the direct solve
  // Of every handle: as many digits of the columns are kept as such poses need.
  double max_rotation_rad = 30.0 * std::numbers::pi / 180.0;
  // Lips that are sealed (docs/lips.md): only with contact rows.
  std::optional<LipEdge> seal = {};
  // May be empty. Called with the bytes that the response needs at most, while it is made and
  // later, before any of them is allocated.
  FactorAdmission admission = nullptr;
  PreparationObserver observer = nullptr;  // may be empty; receives the columns
};

// What poses do with the 12 columns a handle. Moves have no range: a sixth of the mesh, which is 3
// cm on a head, beside those of turns about a far pivot. What is wider is covered as far as the
// digits go that these need.
ColumnWeights ElasticUses(const MeshPreparation& preparation, const ElasticSystem& elastic,
                          double max_rotation_rad);

// Bytes that a response of so many vertices needs at most, while it is made; 12 columns a handle.
int64_t LinearElasticResponseBytes(const MeshPreparation& preparation,
                                   const std::optional<LipEdge>& seal, Eigen::Index num_vertices);

// Linear elasticity at `vertices` (any order), from the columns of ElasticSystem. The model is
// linear in the displacement of a handle, which any pose makes from 12 columns, so nothing is
// truncated and there is no sharp range: the bound is that of what the compression cut and of the
// digits that are kept, and grows with the poses' motion.
//
// Factorises the elastic system if no model has done so. Holds the columns only, not the
// preparation.
//
// Errors: InvalidArgument (a vertex outside [0, #V), no vertex, a tolerance that is not a positive
// number), those of MeshPreparation::Elastic, CheckLipEdge and LipSeal::Create; what the admission
// says, before anything is allocated.
absl::StatusOr<std::unique_ptr<VertexResponse>> CreateLinearElasticResponse(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const LinearElasticResponseOptions& options, const Cancellation& cancellation = {});

}  // namespace tissueform
