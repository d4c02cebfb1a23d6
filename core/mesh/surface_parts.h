// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The connected components of a surface, in the order of their lowest vertices.
struct SurfaceParts {
  std::vector<int32_t> part_of_triangle;  // #F
  // What each encloses, by the divergence theorem: negative when it faces inwards. Means something
  // for closed parts only.
  std::vector<double> volumes_mm3;
};
SurfaceParts FindSurfaceParts(const TriangleMesh& surface);

// How often the closed parts that are chosen wind round a point: the sum of the solid angles of
// their triangles (van Oosterom and Strackee 1983, Eq. 8) over 4 pi. 1 inside one that faces
// outwards, 0 outside and in the cavities of those that are chosen.
double WindingNumber(const TriangleMesh& surface, const SurfaceParts& parts,
                     const std::vector<bool>& chosen, const Eigen::Vector3d& point);

// The surface without the parts that are not kept; vertices and triangles stay in their order.
//
// REQUIRES: one entry a part, one of them true.
TriangleMesh KeepParts(const TriangleMesh& surface, const SurfaceParts& parts,
                       const std::vector<bool>& kept);

}  // namespace tissueform
