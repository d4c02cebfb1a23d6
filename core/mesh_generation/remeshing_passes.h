// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "core/mesh/triangle_mesh.h"
#include "core/mesh_generation/surface_remeshing.h"

namespace tissueform {

// The length that edges shall have at a place.
double WantedLength(const RemeshingOptions& options, const Eigen::Vector3d& place);

// What RemeshSurface does between two looks for intersections: isotropic remeshing of a surface by
// CGAL, again and again from the surface as it was given, with more fine regions every time.
//
// A large surface is cut into slabs of faces, always the same ones whatever the number of threads,
// which are remeshed apart, at the same time; then the seams between them are. A slab that no new
// fine region reaches is not remeshed again.
class RemeshingPasses {
 public:
  // REQUIRES: a closed surface. May throw what CGAL throws.
  explicit RemeshingPasses(const TriangleMesh& surface);
  ~RemeshingPasses();

  // REQUIRES: `options` are those of the call before with no or some fine regions appended.
  // May throw what CGAL throws.
  TriangleMesh Remesh(const RemeshingOptions& options);

 private:
  struct State;
  const std::unique_ptr<State> state_;
};

}  // namespace tissueform
