// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/changing_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace tissueform {

ChangingSurface::ChangingSurface(const TriangleMesh& closed, double feature_angle_deg) {
  places_.reserve(static_cast<size_t>(closed.num_vertices()));
  for (const auto& place : closed.positions().rowwise()) places_.emplace_back(place.transpose());
  from_.reserve(static_cast<size_t>(3 * closed.num_triangles()));
  for (const auto& triangle : closed.triangles().rowwise()) {
    for (const int32_t v : triangle) from_.push_back(v);
  }
  twin_.resize(from_.size());
  is_feature_.resize(from_.size());
  PairHalfEdges();
  GiveFansTheirVertices();
  if (feature_angle_deg > 0) FindFeatures(feature_angle_deg);
}

void ChangingSurface::PairHalfEdges() {
  std::vector<std::array<int32_t, 3>> edges;  // lower vertex, higher vertex, half-edge
  edges.reserve(from_.size());
  for (int32_t h = 0; h < num_half_edges(); ++h) {
    edges.push_back({std::min(From(h), To(h)), std::max(From(h), To(h)), h});
  }
  std::sort(edges.begin(), edges.end());
  for (size_t i = 0; i + 1 < edges.size(); i += 2) Pair(edges[i][2], edges[i + 1][2], false);
}

void ChangingSurface::GiveFansTheirVertices() {
  out_.assign(places_.size(), -1);
  std::vector<bool> seen(from_.size());
  for (int32_t first = 0; first < num_half_edges(); ++first) {
    if (seen[first]) continue;
    int32_t v = From(first);
    if (HasVertex(v)) {
      places_.push_back(Eigen::Vector3d(Place(v)));
      out_.push_back(-1);
      v = num_vertices() - 1;
    }
    out_[v] = first;
    ForEachOut(v, [&](int32_t h) {
      seen[h] = true;
      from_[h] = v;
    });
  }
}

void ChangingSurface::FindFeatures(double angle_deg) {
  const double cosine = std::cos(angle_deg * std::numbers::pi / 180);
  for (int32_t h = 0; h < num_half_edges(); ++h) {
    const Eigen::Vector3d here = Normal(h);
    const Eigen::Vector3d beyond = Normal(Twin(h));
    is_feature_[h] = here.dot(beyond) < cosine * here.norm() * beyond.norm();
  }
}

void ChangingSurface::Pair(int32_t h, int32_t twin, bool is_feature) {
  twin_[h] = twin;
  twin_[twin] = h;
  is_feature_[h] = is_feature;
  is_feature_[twin] = is_feature;
}

int ChangingSurface::Valence(int32_t v) const {
  int valence = 0;
  ForEachOut(v, [&](int32_t) { ++valence; });
  return valence;
}

int ChangingSurface::NumFeatures(int32_t v) const {
  int features = 0;
  ForEachOut(v, [&](int32_t h) { features += IsFeature(h) ? 1 : 0; });
  return features;
}

bool ChangingSurface::AreNeighbours(int32_t v, int32_t other) const {
  bool found = false;
  ForEachOut(v, [&](int32_t h) { found = found || To(h) == other; });
  return found;
}

int32_t ChangingSurface::Split(int32_t h) {
  // Triangles a b c and b a d become a m c, b m d and the new m b c, m a d.
  const int32_t g = Twin(h);
  const int32_t bc = Next(h);
  const int32_t ad = Next(g);
  const int32_t a = From(h);
  const int32_t b = From(g);
  const int32_t c = Opposite(h);
  const int32_t d = Opposite(g);
  const int32_t m = num_vertices();
  const int32_t first = num_half_edges();
  const int32_t second = first + 3;
  const bool is_feature = IsFeature(h);
  places_.push_back(0.5 * (Place(a) + Place(b)));
  from_.insert(from_.end(), {m, b, c, m, a, d});
  twin_.resize(from_.size());
  is_feature_.resize(from_.size());
  from_[bc] = m;
  from_[ad] = m;
  Pair(first + 1, Twin(bc), IsFeature(bc));
  Pair(second + 1, Twin(ad), IsFeature(ad));
  Pair(bc, first + 2, false);
  Pair(ad, second + 2, false);
  Pair(h, second, is_feature);
  Pair(g, first, is_feature);
  out_.push_back(bc);
  out_[a] = h;
  out_[b] = g;
  return m;
}

bool ChangingSurface::CanCollapse(int32_t h) const {
  // The ends have no neighbours in common but the two corners beside the edge, and these keep three
  // neighbours.
  const int32_t a = From(h);
  const int32_t b = To(h);
  int common = 0;
  ForEachOut(a, [&](int32_t out) {
    if (To(out) != b && AreNeighbours(b, To(out))) ++common;
  });
  return common == 2 && Valence(Opposite(h)) > 3 && Valence(Opposite(Twin(h))) > 3;
}

void ChangingSurface::Collapse(int32_t h) {
  const int32_t g = Twin(h);
  const int32_t a = From(h);
  const int32_t b = To(h);
  const int32_t c = Opposite(h);
  const int32_t d = Opposite(g);
  std::vector<int32_t> outs;
  outs.reserve(16);
  ForEachOut(a, [&](int32_t out) { outs.push_back(out); });
  for (const int32_t out : outs) from_[out] = b;
  const int32_t b_to_c = Twin(Previous(h));
  const int32_t c_to_b = Twin(Next(h));
  const int32_t d_to_b = Twin(Next(g));
  const int32_t b_to_d = Twin(Previous(g));
  Pair(b_to_c, c_to_b, IsFeature(b_to_c) || IsFeature(c_to_b));
  Pair(b_to_d, d_to_b, IsFeature(b_to_d) || IsFeature(d_to_b));
  out_[a] = -1;
  out_[b] = b_to_c;
  out_[c] = c_to_b;
  out_[d] = d_to_b;
  for (const int32_t gone : {h, g}) {
    from_[gone] = -1;
    from_[Next(gone)] = -1;
    from_[Previous(gone)] = -1;
  }
}

bool ChangingSurface::CanFlip(int32_t h) const {
  const int32_t c = Opposite(h);
  const int32_t d = Opposite(Twin(h));
  return c != d && !IsFeature(h) && Valence(From(h)) > 3 && Valence(To(h)) > 3 &&
         !AreNeighbours(c, d);
}

void ChangingSurface::Flip(int32_t h) {
  // Triangles a b c and b a d become d c a and c d b, in the same places.
  const int32_t g = Twin(h);
  const int32_t bc = Next(h);
  const int32_t ca = Previous(h);
  const int32_t ad = Next(g);
  const int32_t db = Previous(g);
  const int32_t a = From(h);
  const int32_t b = From(g);
  const int32_t c = From(ca);
  const int32_t d = From(db);
  const std::array<std::pair<int32_t, bool>, 4> beyond = {
      std::pair{Twin(ca), IsFeature(ca)}, std::pair{Twin(ad), IsFeature(ad)},
      std::pair{Twin(db), IsFeature(db)}, std::pair{Twin(bc), IsFeature(bc)}};
  const std::array<int32_t, 4> slots = {bc, ca, ad, db};
  const std::array<int32_t, 4> corners = {c, a, d, b};
  from_[h] = d;
  from_[g] = c;
  for (size_t k = 0; k < slots.size(); ++k) {
    from_[slots[k]] = corners[k];
    out_[corners[k]] = slots[k];
  }
  for (size_t k = 0; k < slots.size(); ++k) Pair(slots[k], beyond[k].first, beyond[k].second);
}

TriangleMesh ChangingSurface::Compact() const {
  std::vector<int32_t> number(places_.size(), -1);
  const auto vertices = std::count_if(out_.begin(), out_.end(), [](int32_t h) { return h >= 0; });
  Positions positions(vertices, 3);
  int32_t next = 0;
  for (int32_t v = 0; v < num_vertices(); ++v) {
    if (!HasVertex(v)) continue;
    positions.row(next) = Place(v).transpose();
    number[v] = next++;
  }
  const auto kept = std::count_if(from_.begin(), from_.end(), [](int32_t v) { return v >= 0; });
  TriangleIndices triangles(kept / 3, 3);
  Eigen::Index row = 0;
  for (int32_t h = 0; h < num_half_edges(); h += 3) {
    if (!HasHalfEdge(h)) continue;
    triangles.row(row++) << number[from_[h]], number[from_[h + 1]], number[from_[h + 2]];
  }
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

}  // namespace tissueform
