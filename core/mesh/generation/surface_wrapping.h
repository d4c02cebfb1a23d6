// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/status/statusor.h"

#include "core/base/process/helper_program.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The wrap enters openings and gaps that are wider than twice this many offsets and bridges
// narrower ones.
inline constexpr double kAlphaPerOffset = 3;

// More triangles than any mesh of a jaw needs; a wrap of so many takes about two minutes and 3 GiB.
inline constexpr int64_t kMaxWrapTriangles = 1'500'000;

struct WrappingOptions {
  double offset_mm = 0;  // > 0: distance of the wrap from the surface
  int threads = 1;       // for the distances; the result does not depend on it
  IsolationLimits limits{.max_memory_bytes = int64_t{4} << 30, .max_seconds = 300};
};

struct WrappedSurface {
  TriangleMesh mesh;  // closed, manifold, facing outward, free of intersections
  // From the wrap's vertices, edge midpoints and centroids to the surface. The vertices are
  // offset_mm away; what bridges an opening is farther away, by at most alpha.
  double largest_to_surface_mm = 0;
  // From the surface's vertices and centroids to the wrap. Larger than the offset where the wrap
  // bridges a gap or covers inner walls.
  double largest_from_surface_mm = 0;
  double covered_fraction = 0;  // of those points: deeper in the wrap than offset and a half
  double volume_mm3 = 0;        // inside the wrap
  // The wrap went through an opening and follows the surface on both sides: it encloses a sheet of
  // twice the offset and not what the surface goes around.
  bool is_sheet = false;
};

// How many triangles the wrap of a surface with this area has, within a factor of 2.
double EstimatedWrapTriangles(double area_mm2, double offset_mm);

// The smallest offset, in mm, whose wrap bridges every opening of the surface; 0 where it has none.
double OffsetThatBridges(const TriangleMesh& surface);

// A closed surface around any triangles, by alpha wrapping (Portaneri and others, 2022; CGAL) in a
// helper program: they may be open, intersect, face both ways and lie in several pieces.
// Deterministic.
//
// Errors: InvalidArgument when the offset is not positive, when a coordinate is not finite, when no
// triangle has an area, or when the wrap would have more than kMaxWrapTriangles (the message names
// the offset that suffices); ResourceExhausted when a limit of the options stopped the wrapping.
absl::StatusOr<WrappedSurface> WrapSurface(const TriangleMesh& surface,
                                           const WrappingOptions& options);

}  // namespace tissueform
