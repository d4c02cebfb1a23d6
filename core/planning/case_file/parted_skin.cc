// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/parted_skin.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

#include "core/mechanics/constraints/doubled_vertices.h"
#include "core/mesh/nearest_point.h"
#include "core/planning/case_file/mesh_surfaces.h"
#include "core/planning/case_file/skin_follow.h"

namespace tissueform {
namespace {

using Eigen::Index;

// Which lip: that of the doubles, that of the vertices which they double, or neither.
constexpr int kDoubles = -1;
constexpr int kNeither = 0;
constexpr int kFirsts = 1;

// A skin has triangles of about a millimeter and the mesh of two or three: what crosses the seam
// follows the mesh within so many of its edges. More would cut on beyond the corners of the mouth.
constexpr int kEdgesFromSeam = 2;

// Of every vertex of the mesh.
std::vector<int> LipOfVertex(const TriangleIndices& facets, const std::vector<int32_t>& first) {
  std::vector<int> lip(first.size(), kNeither);
  for (size_t v = 0; v < first.size(); ++v) {
    if (first[v] == static_cast<int32_t>(v)) continue;
    lip[v] = kDoubles;
    lip[static_cast<size_t>(first[v])] = kFirsts;
  }
  for (int round = 0; round < kEdgesFromSeam; ++round) {
    const std::vector<int> before = lip;
    for (Index f = 0; f < facets.rows(); ++f) {
      for (int k = 0; k < 3; ++k) {
        const int of_neighbor = before[static_cast<size_t>(facets(f, (k + 1) % 3))];
        int& own = lip[static_cast<size_t>(facets(f, k))];
        if (own == kNeither) own = of_neighbor;
      }
    }
  }
  return lip;
}

// The mesh's skin with numbers of the mesh's vertices.
TriangleIndices FacetsOf(const CaseSurface& mesh_skin) {
  return mesh_skin.triangles.unaryExpr(
      [&](int32_t v) { return mesh_skin.follows->vertices(v, 0); });
}

// The facets of one lip near the seam.
TriangleIndices FacetsOfLip(const TriangleIndices& facets, const std::vector<int>& lip, int which) {
  std::vector<Index> chosen;
  for (Index f = 0; f < facets.rows(); ++f) {
    const std::array<int, 3> lips = {lip[static_cast<size_t>(facets(f, 0))],
                                     lip[static_cast<size_t>(facets(f, 1))],
                                     lip[static_cast<size_t>(facets(f, 2))]};
    const auto has = [&](int wanted) { return std::ranges::count(lips, wanted) > 0; };
    if (has(which) && !has(-which)) chosen.push_back(f);
  }
  return facets(chosen, Eigen::all);
}

// The lip that a vertex of the skin follows most.
int LipFollowed(const FollowedVertices& follows, Index v, const std::vector<int>& lip) {
  Index most = 0;
  if (!(follows.weights.row(v).maxCoeff(&most) > 0)) return kNeither;
  return lip[static_cast<size_t>(follows.vertices(v, most))];
}

// Rows are appended to the skin, each a vertex that follows the other lip.
class SkinParter {
 public:
  SkinParter(const TetMesh& mesh, const TriangleIndices& facets, std::vector<int> lip,
             CaseSurface* skin)
      : mesh_(mesh), facets_(facets), lip_(std::move(lip)), skin_(*skin) {}

  void Part() {
    for (Index t = 0; t < skin_.triangles.rows(); ++t) {
      const int lip = LipOfTriangle(t);
      if (lip == kNeither) continue;
      for (int k = 0; k < 3; ++k) {
        int32_t& vertex = skin_.triangles(t, k);
        if (LipFollowed(*skin_.follows, vertex, lip_) == -lip) vertex = DoubleOf(vertex, lip);
      }
    }
    Append();
  }

 private:
  // That of most of its vertices where they follow both lips; else kNeither.
  int LipOfTriangle(Index t) const {
    int sum = 0;
    bool follows_doubles = false;
    bool follows_firsts = false;
    for (int k = 0; k < 3; ++k) {
      const int lip = LipFollowed(*skin_.follows, skin_.triangles(t, k), lip_);
      sum += lip;
      follows_doubles |= lip == kDoubles;
      follows_firsts |= lip == kFirsts;
    }
    if (!follows_doubles || !follows_firsts) return kNeither;
    return sum >= 0 ? kFirsts : kDoubles;
  }

  int32_t DoubleOf(int32_t vertex, int lip) {
    const auto next =
        static_cast<int32_t>(skin_.positions.rows()) + static_cast<int32_t>(double_of_.size());
    // Every vertex is of one lip, so that it has one double at most.
    const auto [entry, is_new] = double_of_.try_emplace(vertex, next);
    if (is_new) doubles_.push_back({.vertex = vertex, .lip = lip});
    return entry->second;
  }

  void Append() {
    const Index before = skin_.positions.rows();
    const Index after = before + static_cast<Index>(doubles_.size());
    skin_.positions.conservativeResize(after, Eigen::NoChange);
    skin_.follows->vertices.conservativeResize(after, Eigen::NoChange);
    skin_.follows->weights.conservativeResize(after, Eigen::NoChange);
    const TriangleIndices of_firsts = FacetsOfLip(facets_, lip_, kFirsts);
    const TriangleIndices of_doubles = FacetsOfLip(facets_, lip_, kDoubles);
    const NearbyTriangles near_firsts(mesh_.positions(), of_firsts, kFollowsMm);
    const NearbyTriangles near_doubles(mesh_.positions(), of_doubles, kFollowsMm);
    for (size_t d = 0; d < doubles_.size(); ++d) {
      const auto [vertex, lip] = doubles_[d];
      const bool is_first = lip == kFirsts;
      Follow(vertex, before + static_cast<Index>(d), is_first ? near_firsts : near_doubles,
             is_first ? of_firsts : of_doubles);
    }
  }

  // The double follows the nearest point of the other lip that faces the same way as the facet that
  // was followed before, with the same share. Without such a point it follows as its vertex does.
  void Follow(int32_t vertex, Index row, const NearbyTriangles& nearby,
              const TriangleIndices& facets) {
    FollowedVertices& follows = *skin_.follows;
    skin_.positions.row(row) = skin_.positions.row(vertex);
    follows.vertices.row(row) = follows.vertices.row(vertex);
    follows.weights.row(row) = follows.weights.row(vertex);
    const Eigen::Vector3d place = skin_.positions.row(vertex).cast<double>();
    const std::optional<NearestOnSurface> nearest = nearby.Nearest(place, NormalFollowed(vertex));
    if (!nearest) return;
    const float share = follows.weights.row(vertex).sum();
    for (int k = 0; k < 3; ++k) {
      follows.vertices(row, k) = facets(nearest->triangle, k);
      follows.weights(row, k) = share * static_cast<float>(nearest->shares[k]);
    }
  }

  Eigen::Vector3d NormalFollowed(int32_t vertex) const {
    const auto corner = [&](int k) -> Eigen::Vector3d {
      return mesh_.positions().row(skin_.follows->vertices(vertex, k));
    };
    return (corner(1) - corner(0)).cross(corner(2) - corner(0));
  }

  struct Double {
    int32_t vertex = 0;
    int lip = kNeither;
  };

  const TetMesh& mesh_;
  const TriangleIndices& facets_;
  const std::vector<int> lip_;
  CaseSurface& skin_;
  std::map<int32_t, int32_t> double_of_;
  std::vector<Double> doubles_;
};

}  // namespace

void PartSkin(const TetMesh& mesh, const ConstraintSet& sticking,
              const std::vector<ContactRow>& rows, CaseSurface* skin) {
  const std::optional<CaseSurface> mesh_skin = SkinOfMesh(mesh, sticking, {});
  if (!mesh_skin) return;
  const TriangleIndices facets = FacetsOf(*mesh_skin);
  const std::vector<int32_t> first = *FirstAtPlace(mesh.positions(), rows);
  SkinParter(mesh, facets, LipOfVertex(facets, first), skin).Part();
}

std::optional<CaseSurface> InsidesOfLips(const TetMesh& mesh, const ConstraintSet& sticking,
                                         const std::vector<ContactRow>& rows) {
  std::optional<CaseSurface> surface = SkinOfMesh(mesh, sticking, {});
  if (!surface) return std::nullopt;
  const std::vector<int32_t> first = *FirstAtPlace(mesh.positions(), rows);
  const TriangleIndices facets = FacetsOf(*surface);
  std::map<std::array<int32_t, 3>, std::vector<Index>> at_place;
  for (Index f = 0; f < facets.rows(); ++f) {
    std::array<int32_t, 3> corners = {};
    for (int k = 0; k < 3; ++k) corners[k] = first[static_cast<size_t>(facets(f, k))];
    std::ranges::sort(corners);
    at_place[corners].push_back(f);
  }
  std::vector<Index> inside;
  for (const auto& [corners, here] : at_place) {
    if (here.size() == 2) inside.insert(inside.end(), here.begin(), here.end());
  }
  if (inside.empty()) return std::nullopt;
  return SurfaceOf("insides of the lips", mesh, facets(inside, Eigen::all));
}

}  // namespace tissueform
