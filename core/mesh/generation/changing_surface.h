// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// A closed surface whose edges can be split, collapsed and flipped. Half-edge 3 t + k runs from
// corner k of triangle t to the next one; its twin runs back in the neighbour. Triangles and
// vertices that a collapse takes away keep their numbers, which name nothing then.
class ChangingSurface {
 public:
  // Where parts touch at a vertex, each gets its own; edges that bend by more than the angle are
  // features (0: none).
  // REQUIRES: every edge has two triangles that run through it in opposite directions; fewer than
  // 2^29 triangles.
  ChangingSurface(const TriangleMesh& closed, double feature_angle_deg);

  int32_t num_half_edges() const { return static_cast<int32_t>(from_.size()); }
  int32_t num_vertices() const { return static_cast<int32_t>(places_.size()); }
  bool HasHalfEdge(int32_t h) const { return from_[h] >= 0; }
  bool HasVertex(int32_t v) const { return out_[v] >= 0; }

  static int32_t Next(int32_t h) { return h % 3 == 2 ? h - 2 : h + 1; }
  static int32_t Previous(int32_t h) { return h % 3 == 0 ? h + 2 : h - 1; }
  int32_t Twin(int32_t h) const { return twin_[h]; }
  int32_t From(int32_t h) const { return from_[h]; }
  int32_t To(int32_t h) const { return from_[Next(h)]; }
  // The corner of the half-edge's triangle that is not on it.
  int32_t Opposite(int32_t h) const { return from_[Previous(h)]; }
  bool IsFeature(int32_t h) const { return is_feature_[h]; }

  const Eigen::Vector3d& Place(int32_t v) const { return places_[v]; }
  void Move(int32_t v, const Eigen::Vector3d& place) { places_[v] = place; }
  double SquaredLength(int32_t h) const { return (Place(To(h)) - Place(From(h))).squaredNorm(); }
  // Twice the triangle's area long.
  Eigen::Vector3d Normal(int32_t h) const { return NormalWith(h, Place(From(h))); }
  // As it would be with the start of the half-edge elsewhere.
  Eigen::Vector3d NormalWith(int32_t h, const Eigen::Vector3d& start) const {
    return (Place(To(h)) - start).cross(Place(Opposite(h)) - start);
  }

  // Calls visit(h) for the half-edges that begin at the vertex, in turn.
  template <typename Visit>
  void ForEachOut(int32_t v, Visit visit) const {
    int32_t h = out_[v];
    do {
      visit(h);
      h = Twin(Previous(h));
    } while (h != out_[v]);
  }
  int Valence(int32_t v) const;
  int NumFeatures(int32_t v) const;  // edges
  bool AreNeighbours(int32_t v, int32_t other) const;

  // Puts a new vertex, which is returned, into the middle of the edge; the two parts of a feature
  // are features.
  int32_t Split(int32_t h);
  // Whether the surface stays one without the half-edge's start.
  bool CanCollapse(int32_t h) const;
  // Draws the start into the end. REQUIRES: CanCollapse.
  void Collapse(int32_t h);
  // Whether the two triangles of the edge can have the other diagonal.
  bool CanFlip(int32_t h) const;
  // REQUIRES: CanFlip.
  void Flip(int32_t h);

  // What is left, renumbered in the same order.
  TriangleMesh Compact() const;

 private:
  void PairHalfEdges();
  void GiveFansTheirVertices();
  void FindFeatures(double angle_deg);
  void Pair(int32_t h, int32_t twin, bool is_feature);

  std::vector<int32_t> from_;  // of half-edges; -1 when taken away
  std::vector<int32_t> twin_;
  std::vector<bool> is_feature_;
  std::vector<Eigen::Vector3d> places_;  // of vertices
  std::vector<int32_t> out_;             // some half-edge that begins there; -1 when taken away
};

}  // namespace tissueform
