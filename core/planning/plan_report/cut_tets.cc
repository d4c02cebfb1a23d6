// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/cut_tets.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

Eigen::Vector3d Barycentre(const TetMesh& mesh, Eigen::Index tet) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int corner = 0; corner < 4; ++corner) {
    sum += mesh.positions().row(mesh.tets()(tet, corner)).transpose();
  }
  return sum / 4;
}

// Facets of one tet only, by their sorted corners.
class OpenFacets {
 public:
  void Add(const std::array<int32_t, 3>& facet, Eigen::Index tet) {
    std::array<int32_t, 3> key = facet;
    std::sort(key.begin(), key.end());
    const auto [place, is_new] = facets_.try_emplace(key, facet, tet);
    if (!is_new) facets_.erase(place);
  }
  const auto& facets() const { return facets_; }

 private:
  std::map<std::array<int32_t, 3>, std::pair<std::array<int32_t, 3>, Eigen::Index>> facets_;
};

}  // namespace

SurfaceLayer CutTets(const TetMesh& mesh, const Plane& plane, const std::vector<Colour>& colours) {
  OpenFacets open;
  for (Eigen::Index t = 0; t < mesh.num_tets(); ++t) {
    if (plane.HeightMm(Barycentre(mesh, t)) < 0) continue;
    for (const std::array<int, 3>& facet : kTetFacets) {
      open.Add({mesh.tets()(t, facet[0]), mesh.tets()(t, facet[1]), mesh.tets()(t, facet[2])}, t);
    }
  }
  SurfaceLayer layer{.positions = mesh.positions(), .triangles = {}};
  layer.triangles.resize(static_cast<Eigen::Index>(open.facets().size()), 3);
  Eigen::Index row = 0;
  for (const auto& [key, facet] : open.facets()) {
    layer.triangles.row(row++) << facet.first[0], facet.first[1], facet.first[2];
    layer.triangle_colours.push_back(colours[static_cast<size_t>(facet.second)]);
  }
  return layer;
}

}  // namespace tissueform
