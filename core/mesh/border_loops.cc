// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/border_loops.h"

#include <algorithm>
#include <map>
#include <utility>

namespace tissueform {
namespace {

using NextOnBorder = std::multimap<int32_t, int32_t>;

// Directed edges that one triangle has and no other, in either direction.
NextOnBorder BorderEdges(const TriangleIndices& triangles) {
  std::map<std::pair<int32_t, int32_t>, int> uses;
  const auto edge_key = [](int32_t a, int32_t b) {
    return std::pair(std::min(a, b), std::max(a, b));
  };
  for (const auto& t : triangles.rowwise()) {
    for (int k = 0; k < 3; ++k) ++uses[edge_key(t[k], t[(k + 1) % 3])];
  }
  NextOnBorder next;
  for (const auto& t : triangles.rowwise()) {
    for (int k = 0; k < 3; ++k) {
      const int32_t a = t[k];
      const int32_t b = t[(k + 1) % 3];
      if (a != b && uses[edge_key(a, b)] == 1) next.emplace(a, b);
    }
  }
  return next;
}

// Follows the border from `start` and removes what it follows. A vertex that is met again closes a
// loop of its own, which is handed out.
void FollowBorder(int32_t start, NextOnBorder* next, std::vector<std::vector<int32_t>>* loops) {
  std::vector<int32_t> path = {start};
  std::map<int32_t, size_t> place = {{start, 0}};
  for (auto edge = next->find(start); edge != next->end(); edge = next->find(path.back())) {
    const int32_t vertex = edge->second;
    next->erase(edge);
    const auto met = place.find(vertex);
    if (met == place.end()) {
      place[vertex] = path.size();
      path.push_back(vertex);
      continue;
    }
    const auto first = path.begin() + static_cast<std::ptrdiff_t>(met->second);
    loops->emplace_back(first, path.end());
    for (auto v = first + 1; v != path.end(); ++v) place.erase(*v);
    path.erase(first + 1, path.end());
  }
  if (path.size() > 1) loops->push_back(std::move(path));
}

}  // namespace

std::vector<std::vector<int32_t>> BorderLoops(const TriangleMesh& mesh) {
  NextOnBorder next = BorderEdges(mesh.triangles());
  std::vector<std::vector<int32_t>> loops;
  while (!next.empty()) FollowBorder(next.begin()->first, &next, &loops);
  return loops;
}

double LoopWidthMm(const TriangleMesh& mesh, const std::vector<int32_t>& loop) {
  Eigen::AlignedBox3d box;
  for (const int32_t v : loop) box.extend(mesh.positions().row(v).transpose());
  return box.isEmpty() ? 0 : box.sizes().maxCoeff();
}

TriangleMesh WithOpeningsClosed(const TriangleMesh& mesh,
                                const std::vector<std::vector<int32_t>>& loops) {
  Eigen::Index num_new = 0;
  for (const auto& loop : loops) num_new += static_cast<Eigen::Index>(loop.size());
  Positions positions(mesh.num_vertices() + static_cast<Eigen::Index>(loops.size()), 3);
  TriangleIndices triangles(mesh.num_triangles() + num_new, 3);
  positions.topRows(mesh.num_vertices()) = mesh.positions();
  triangles.topRows(mesh.num_triangles()) = mesh.triangles();
  Eigen::Index vertex = mesh.num_vertices();
  Eigen::Index triangle = mesh.num_triangles();
  for (const std::vector<int32_t>& loop : loops) {
    Eigen::RowVector3d center = Eigen::RowVector3d::Zero();
    for (size_t i = 0; i < loop.size(); ++i) {
      center += mesh.positions().row(loop[i]) / static_cast<double>(loop.size());
      // The border's edges belong to the mesh's triangles; the new ones run through them backward.
      triangles.row(triangle++) << loop[(i + 1) % loop.size()], loop[i],
          static_cast<int32_t>(vertex);
    }
    positions.row(vertex++) = center;
  }
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

}  // namespace tissueform
