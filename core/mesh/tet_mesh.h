// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <utility>

#include "absl/status/statusor.h"

#include "core/base/types.h"

namespace tissueform {

// Tetrahedral mesh in its rest shape. Immutable, so it may be shared between threads and sessions.
// Copies share the arrays.
class TetMesh {
 public:
  // Takes #V by 3 positions in mm and #T by 4 vertex indices.
  //
  // Errors: InvalidArgument when there is no vertex or no tet, or when a tet names a vertex that
  // does not exist (the message names both). Anything else that may be wrong with a mesh is left to
  // ValidateTetMesh (core/mesh/validation.h), which reports instead of refusing.
  static absl::StatusOr<TetMesh> Create(Positions positions, TetIndices tets);

  const Positions& positions() const { return arrays_->positions; }
  const TetIndices& tets() const { return arrays_->tets; }
  Eigen::Index num_vertices() const { return positions().rows(); }
  Eigen::Index num_tets() const { return tets().rows(); }

  // Keeps the arrays alive for readers that use them beyond the life of this mesh.
  std::shared_ptr<const void> storage() const { return arrays_; }

  // Length of the diagonal of the axis-aligned bounding box, in mm: "the size" of the mesh.
  double BoundingBoxDiagonal() const;

 private:
  struct Arrays {
    Positions positions;
    TetIndices tets;
  };

  explicit TetMesh(std::shared_ptr<const Arrays> arrays) : arrays_(std::move(arrays)) {}

  std::shared_ptr<const Arrays> arrays_;
};

}  // namespace tissueform
