// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/tet_topology.h"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace tissueform {
namespace {

// Disjoint sets over vertices; the root of a set is its smallest vertex.
class DisjointSets {
 public:
  explicit DisjointSets(Eigen::Index size) : parent_(size) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int32_t Find(int32_t vertex) {
    while (parent_[vertex] != vertex) {
      // Every second vertex on the way is hung higher: short ways without a rank to decide who is
      // root, which must be the smallest.
      parent_[vertex] = parent_[parent_[vertex]];
      vertex = parent_[vertex];
    }
    return vertex;
  }

  void Unite(int32_t a, int32_t b) {
    a = Find(a);
    b = Find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<int32_t> parent_;
};

struct Facet {
  std::array<int32_t, 3> key;  // rising
  int32_t tet;
  int corner;
};

Facet FacetOf(const TetIndices& tets, int32_t tet, int corner) {
  const auto& local = kTetFacets[corner];
  Facet facet{{tets(tet, local[0]), tets(tet, local[1]), tets(tet, local[2])}, tet, corner};
  std::sort(facet.key.begin(), facet.key.end());
  return facet;
}

// All facets with their copies side by side. Put in the bucket of their smallest vertex first,
// which holds some twenty: several times faster than to sort them all at once.
std::vector<Facet> SortedFacets(const TetMesh& mesh) {
  const TetIndices& tets = mesh.tets();
  std::vector<Facet> unsorted;
  unsorted.reserve(4 * tets.rows());
  std::vector<size_t> ends(mesh.num_vertices() + 1, 0);  // of the buckets, one place on
  for (int32_t t = 0; t < tets.rows(); ++t) {
    for (int corner = 0; corner < 4; ++corner) {
      unsorted.push_back(FacetOf(tets, t, corner));
      ++ends[unsorted.back().key[0] + 1];
    }
  }
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  std::vector<Facet> facets(unsorted.size());
  for (const Facet& facet : unsorted) facets[ends[facet.key[0]]++] = facet;
  auto begin = facets.begin();
  for (Eigen::Index v = 0; v < mesh.num_vertices(); ++v) {
    const auto end = facets.begin() + static_cast<std::ptrdiff_t>(ends[v]);
    std::sort(begin, end, [](const Facet& a, const Facet& b) { return a.key < b.key; });
    begin = end;
  }
  return facets;
}

}  // namespace

ConnectedComponents FindConnectedComponents(const Eigen::Ref<const CellIndices>& cells,
                                            Eigen::Index num_vertices) {
  DisjointSets sets(num_vertices);
  std::vector<bool> referenced(num_vertices, false);
  for (Eigen::Index c = 0; c < cells.rows(); ++c) {
    for (Eigen::Index corner = 0; corner < cells.cols(); ++corner) {
      referenced[cells(c, corner)] = true;
      sets.Unite(cells(c, 0), cells(c, corner));
    }
  }
  ConnectedComponents result;
  result.component_of_vertex.assign(num_vertices, ConnectedComponents::kUnreferenced);
  for (int32_t v = 0; v < num_vertices; ++v) {
    if (!referenced[v]) {
      continue;
    }
    const int32_t root = sets.Find(v);  // root <= v, so it is numbered already
    result.component_of_vertex[v] = root == v ? result.count++ : result.component_of_vertex[root];
  }
  return result;
}

TriangleIndices BoundaryFacets(const TetMesh& mesh) {
  const TetIndices& tets = mesh.tets();
  const std::vector<Facet> facets = SortedFacets(mesh);
  // One without a copy is boundary. The sort that follows brings back the order of the tets.
  std::vector<Facet> boundary;
  for (size_t first = 0; first < facets.size();) {
    size_t last = first + 1;
    while (last < facets.size() && facets[last].key == facets[first].key) {
      ++last;
    }
    if (last - first == 1) {
      boundary.push_back(facets[first]);
    }
    first = last;
  }
  std::sort(boundary.begin(), boundary.end(), [](const Facet& a, const Facet& b) {
    return a.tet != b.tet ? a.tet < b.tet : a.corner < b.corner;
  });
  TriangleIndices result(boundary.size(), 3);
  for (size_t i = 0; i < boundary.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      result(static_cast<Eigen::Index>(i), k) =
          tets(boundary[i].tet, kTetFacets[boundary[i].corner][k]);
    }
  }
  return result;
}

// Facets come in the order of their tets, and no other tet has the same three vertices: one pass
// over both finds each.
std::vector<int32_t> TetsBehind(const TriangleIndices& facets, const TetMesh& mesh) {
  const TetIndices& tets = mesh.tets();
  std::vector<int32_t> behind;
  behind.reserve(facets.rows());
  for (int32_t t = 0; t < tets.rows(); ++t) {
    for (const auto& local : kTetFacets) {
      const auto next = static_cast<Eigen::Index>(behind.size());
      if (next < facets.rows() && facets(next, 0) == tets(t, local[0]) &&
          facets(next, 1) == tets(t, local[1]) && facets(next, 2) == tets(t, local[2])) {
        behind.push_back(t);
      }
    }
  }
  assert(static_cast<Eigen::Index>(behind.size()) == facets.rows());
  return behind;
}

std::vector<int32_t> BoundaryVertices(const TetMesh& mesh) {
  return VerticesOf(BoundaryFacets(mesh));
}

std::vector<int32_t> VerticesOf(const TriangleIndices& facets) {
  std::vector<int32_t> vertices(facets.data(), facets.data() + facets.size());
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

}  // namespace tissueform
