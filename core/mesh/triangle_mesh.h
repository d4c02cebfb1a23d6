// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <utility>

#include "absl/status/statusor.h"

#include "core/base/types.h"

namespace tissueform {

// Triangle mesh in its rest shape. Immutable, so it may be shared between threads and sessions.
// Copies share the arrays.
class TriangleMesh {
 public:
  // Takes #V by 3 positions in mm and #F by 3 vertex indices.
  //
  // Errors: InvalidArgument when there is no vertex or no triangle, or when a triangle names a
  // vertex that does not exist.
  static absl::StatusOr<TriangleMesh> Create(Positions positions, TriangleIndices triangles);

  const Positions& positions() const { return arrays_->positions; }
  const TriangleIndices& triangles() const { return arrays_->triangles; }
  Eigen::Index num_vertices() const { return positions().rows(); }
  Eigen::Index num_triangles() const { return triangles().rows(); }

  // Keeps the arrays alive for readers that use them beyond the life of this mesh.
  std::shared_ptr<const void> storage() const { return arrays_; }

 private:
  struct Arrays {
    Positions positions;
    TriangleIndices triangles;
  };

  explicit TriangleMesh(std::shared_ptr<const Arrays> arrays) : arrays_(std::move(arrays)) {}

  std::shared_ptr<const Arrays> arrays_;
};

}  // namespace tissueform
