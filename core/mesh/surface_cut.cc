// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/surface_cut.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace tissueform {
namespace {

// Nearer to an end of its edge a cut would leave needles.
constexpr double kNearestToEnd = 0.02;

class SurfaceCut {
 public:
  SurfaceCut(const TriangleMesh& surface, const Eigen::VectorXd& heights)
      : surface_(surface), heights_(heights) {}

  TriangleMesh Cut() {
    for (const auto& triangle : surface_.triangles().rowwise()) {
      // The corner that lies alone on its side comes first.
      int alone = -1;
      for (int k = 0; k < 3; ++k) {
        const bool side = IsAbove(triangle[k]);
        const bool is_alone =
            IsAbove(triangle[(k + 1) % 3]) != side && IsAbove(triangle[(k + 2) % 3]) != side;
        if (is_alone) alone = k;
      }
      if (alone < 0) {
        triangles_.push_back({triangle[0], triangle[1], triangle[2]});
      } else {
        CutOff(triangle[alone], triangle[(alone + 1) % 3], triangle[(alone + 2) % 3]);
      }
    }
    return Result();
  }

 private:
  bool IsAbove(int32_t v) const { return heights_[v] > 0; }

  void CutOff(int32_t a, int32_t b, int32_t c) {
    const int32_t ab = OnEdge(a, b);
    const int32_t ac = OnEdge(a, c);
    triangles_.push_back({a, ab, ac});
    triangles_.push_back({ab, b, c});
    triangles_.push_back({ab, c, ac});
  }

  int32_t OnEdge(int32_t a, int32_t b) {
    const std::pair<int32_t, int32_t> edge = std::minmax(a, b);
    const auto number =
        static_cast<int32_t>(surface_.num_vertices() + static_cast<Eigen::Index>(added_.size()));
    const auto [place, is_new] = of_edge_.try_emplace(edge, number);
    if (is_new) {
      const double from = heights_[edge.first];
      const double part =
          std::clamp(from / (from - heights_[edge.second]), kNearestToEnd, 1 - kNearestToEnd);
      added_.emplace_back((1 - part) * surface_.positions().row(edge.first) +
                          part * surface_.positions().row(edge.second));
    }
    return place->second;
  }

  TriangleMesh Result() const {
    const Eigen::Index old = surface_.num_vertices();
    Positions positions(old + static_cast<Eigen::Index>(added_.size()), 3);
    positions.topRows(old) = surface_.positions();
    for (size_t v = 0; v < added_.size(); ++v) {
      positions.row(old + static_cast<Eigen::Index>(v)) = added_[v];
    }
    TriangleIndices triangles(static_cast<Eigen::Index>(triangles_.size()), 3);
    for (size_t f = 0; f < triangles_.size(); ++f) {
      for (int k = 0; k < 3; ++k) {
        triangles(static_cast<Eigen::Index>(f), k) = triangles_[f][static_cast<size_t>(k)];
      }
    }
    return *TriangleMesh::Create(std::move(positions), std::move(triangles));
  }

  const TriangleMesh& surface_;
  const Eigen::VectorXd& heights_;
  std::map<std::pair<int32_t, int32_t>, int32_t> of_edge_;
  std::vector<Eigen::RowVector3d> added_;
  std::vector<std::array<int32_t, 3>> triangles_;
};

}  // namespace

TriangleMesh CutWhereZero(const TriangleMesh& surface, const Eigen::VectorXd& heights) {
  return SurfaceCut(surface, heights).Cut();
}

}  // namespace tissueform
