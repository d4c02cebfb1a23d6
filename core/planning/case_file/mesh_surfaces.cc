// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/mesh_surfaces.h"

#include <array>
#include <string>
#include <utility>

#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

using Eigen::Index;

constexpr int kFreeVertex = -2;

// Of every vertex its handle, ConstraintSet::kFixed or kFreeVertex.
std::vector<int> RegionOfVertex(const TetMesh& mesh, const ConstraintSet& constraints) {
  std::vector<int> region(static_cast<size_t>(mesh.num_vertices()), kFreeVertex);
  for (size_t c = 0; c < constraints.constrained().size(); ++c) {
    region[static_cast<size_t>(constraints.constrained()[c])] =
        constraints.region_of_constrained()[c];
  }
  return region;
}

// The facets with the vertices that they use, in the order of these; `from` states which they were.
CaseSurface Compacted(const TetMesh& mesh, const TriangleIndices& facets,
                      std::vector<int32_t>* from) {
  std::vector<int32_t> number(static_cast<size_t>(mesh.num_vertices()), -1);
  for (const int32_t v : facets.reshaped()) number[static_cast<size_t>(v)] = 0;
  for (size_t v = 0; v < number.size(); ++v) {
    if (number[v] < 0) continue;
    number[v] = static_cast<int32_t>(from->size());
    from->push_back(static_cast<int32_t>(v));
  }
  CaseSurface surface;
  surface.positions = mesh.positions()(*from, Eigen::all).cast<float>();
  surface.triangles = facets.unaryExpr([&](int32_t v) { return number[static_cast<size_t>(v)]; });
  return surface;
}

}  // namespace

std::optional<CaseSurface> SkinOfMesh(const TetMesh& mesh, const ConstraintSet& constraints,
                                      const std::vector<uint8_t>& region_of_vertex) {
  const std::vector<int> region = RegionOfVertex(mesh, constraints);
  const TriangleIndices boundary = BoundaryFacets(mesh);
  std::vector<Index> chosen;
  for (Index f = 0; f < boundary.rows(); ++f) {
    const auto is_free = [&](int32_t v) { return region[static_cast<size_t>(v)] == kFreeVertex; };
    if (is_free(boundary(f, 0)) || is_free(boundary(f, 1)) || is_free(boundary(f, 2))) {
      chosen.push_back(f);
    }
  }
  if (chosen.empty()) return std::nullopt;
  CaseSurface skin = SurfaceOf("skin", mesh, boundary(chosen, Eigen::all));
  if (!region_of_vertex.empty()) {
    for (const int32_t v : skin.follows->vertices.col(0)) {
      skin.regions.push_back(region_of_vertex[static_cast<size_t>(v)]);
    }
  }
  return skin;
}

CaseSurface SurfaceOf(std::string name, const TetMesh& mesh, const TriangleIndices& facets) {
  std::vector<int32_t> from;
  CaseSurface surface = Compacted(mesh, facets, &from);
  surface.name = std::move(name);
  FollowedVertices follows;
  follows.vertices.resize(surface.positions.rows(), 3);
  follows.weights.setZero(surface.positions.rows(), 3);
  follows.weights.col(0).setOnes();
  for (size_t v = 0; v < from.size(); ++v) {
    follows.vertices.row(static_cast<Index>(v)).setConstant(from[v]);
  }
  surface.follows = std::move(follows);
  return surface;
}

std::vector<CaseSurface> SegmentsOfMesh(const TetMesh& mesh, const ConstraintSet& constraints) {
  const std::vector<int> region = RegionOfVertex(mesh, constraints);
  const TriangleIndices boundary = BoundaryFacets(mesh);
  std::vector<std::vector<Index>> chosen(constraints.handles().size());
  for (Index f = 0; f < boundary.rows(); ++f) {
    const int handle = region[static_cast<size_t>(boundary(f, 0))];
    if (handle >= 0 && region[static_cast<size_t>(boundary(f, 1))] == handle &&
        region[static_cast<size_t>(boundary(f, 2))] == handle) {
      chosen[static_cast<size_t>(handle)].push_back(f);
    }
  }
  std::vector<CaseSurface> segments;
  for (size_t h = 0; h < chosen.size(); ++h) {
    if (chosen[h].empty()) continue;
    // Out of the tissue is into the bone: the other way round.
    const TriangleIndices facets =
        boundary(chosen[h], Eigen::all)(Eigen::all, std::array<int, 3>{0, 2, 1});
    std::vector<int32_t> from;
    CaseSurface segment = Compacted(mesh, facets, &from);
    segment.name = constraints.handles()[h].name;
    segment.kind = SurfaceKind::kSegment;
    segment.handle = segment.name;
    segments.push_back(std::move(segment));
  }
  return segments;
}

}  // namespace tissueform
