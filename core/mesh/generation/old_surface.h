// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The old surface, to which the vertices of a new one are drawn.
class OldSurface {
 public:
  explicit OldSurface(const TriangleMesh& surface);
  ~OldSurface();

  // The nearest point, and the normal (of length 1; 0 without area) of the triangle that it is on.
  // May be asked by several threads.
  struct Hit {
    Eigen::Vector3d place;
    Eigen::Vector3d normal;
  };
  Hit Nearest(const Eigen::Vector3d& place) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace tissueform
