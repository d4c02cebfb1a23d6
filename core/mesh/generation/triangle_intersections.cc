// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/triangle_intersections.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/box_intersection_d.h>
#include <CGAL/intersections.h>

#include "core/mesh/vertex_groups.h"

namespace tissueform {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Box = CGAL::Box_intersection_d::Box_with_info_d<double, 3, int32_t>;

// Ends CGAL's search, which has no way to stop it.
struct EnoughPairs {};

struct Corner {
  int32_t vertex;  // the first one at its place
  Point point;
};
using Corners = std::array<Corner, 3>;

Kernel::Triangle_3 TriangleOf(const Corners& t) { return {t[0].point, t[1].point, t[2].point}; }

// Moves the corners that the triangles share to the front of both, in the same order.
int AlignShared(Corners* a, Corners* b) {
  int shared = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = shared; j < 3; ++j) {
      if ((*a)[i].vertex != (*b)[j].vertex) continue;
      std::swap((*a)[i], (*a)[shared]);
      std::swap((*b)[j], (*b)[shared]);
      ++shared;
      break;
    }
  }
  return shared;
}

// Of two triangles that share one vertex. With another point in common they share the way to it
// from the vertex; further along it one of them ends first, at its edge opposite to the vertex,
// inside the other. So these two edges decide.
bool CrossBeyondVertex(const Corners& a, const Corners& b) {
  return CGAL::do_intersect(TriangleOf(a), Kernel::Segment_3(b[1].point, b[2].point)) ||
         CGAL::do_intersect(TriangleOf(b), Kernel::Segment_3(a[1].point, a[2].point));
}

// Of two triangles that share an edge: they lie on each other when they are in one plane, on one
// side of the edge.
bool OverlapBeyondEdge(const Corners& a, const Corners& b) {
  return CGAL::coplanar(a[0].point, a[1].point, a[2].point, b[2].point) &&
         CGAL::coplanar_orientation(a[0].point, a[1].point, a[2].point, b[2].point) ==
             CGAL::POSITIVE;
}

bool Intersect(Corners a, Corners b) {
  switch (AlignShared(&a, &b)) {
    case 0:
      return CGAL::do_intersect(TriangleOf(a), TriangleOf(b));
    case 1:
      return CrossBeyondVertex(a, b);
    case 2:
      return OverlapBeyondEdge(a, b);
    default:
      return false;
  }
}

std::vector<Corners> CornersOf(const TriangleMesh& mesh) {
  const std::vector<int32_t> first_at_place = FirstVertexAtSamePlace(mesh.positions());
  std::vector<Corners> corners(static_cast<size_t>(mesh.num_triangles()));
  for (Eigen::Index f = 0; f < mesh.num_triangles(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int32_t v = mesh.triangles()(f, k);
      const auto p = mesh.positions().row(v);
      corners[f][k] = {first_at_place[v], Point(p[0], p[1], p[2])};
    }
  }
  return corners;
}

std::vector<Box> BoxesOf(const std::vector<Corners>& corners) {
  std::vector<Box> boxes;
  for (size_t f = 0; f < corners.size(); ++f) {
    const Kernel::Triangle_3 triangle = TriangleOf(corners[f]);
    if (!triangle.is_degenerate()) boxes.emplace_back(triangle.bbox(), static_cast<int32_t>(f));
  }
  return boxes;
}

}  // namespace

TriangleIntersections FindTriangleIntersections(const TriangleMesh& mesh, int64_t most_pairs) {
  const std::vector<Corners> corners = CornersOf(mesh);
  std::vector<Box> boxes = BoxesOf(corners);
  TriangleIntersections found;
  const auto examine = [&](const Box& p, const Box& q) {
    const int32_t a = std::min(p.info(), q.info());
    const int32_t b = std::max(p.info(), q.info());
    if (!Intersect(corners[a], corners[b])) return;
    if (static_cast<int64_t>(found.pairs.size()) >= most_pairs) throw EnoughPairs();
    found.pairs.push_back({a, b});
  };
  try {
    CGAL::box_self_intersection_d(boxes.begin(), boxes.end(), examine);
  } catch (const EnoughPairs&) {
    found.complete = false;
  }
  std::sort(found.pairs.begin(), found.pairs.end());
  return found;
}

}  // namespace tissueform
