// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/tet_voxels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

// The plane of a face, from its vertices in ascending order: the same numbers for both its tets.
struct FacePlane {
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
  double inner_sign = 0;  // of Side on the tet's side; 0 in a tet without volume

  double Side(const Eigen::Vector3d& p) const { return normal.dot(p - point); }
};

using Planes = std::array<FacePlane, 4>;
using IndexRange = std::array<int, 2>;

class TetShape {
 public:
  TetShape(const Positions& voxel_positions, const TetIndices& tets, Eigen::Index tet) {
    std::array<int32_t, 4> corners{};
    std::copy_n(tets.row(tet).data(), 4, corners.begin());
    std::sort(corners.begin(), corners.end());
    for (size_t opposite = 0; opposite < 4; ++opposite) {
      std::array<Eigen::Vector3d, 3> face;
      size_t count = 0;
      for (size_t i = 0; i < 4; ++i) {
        if (i != opposite) face[count++] = voxel_positions.row(corners[i]);
      }
      FacePlane& plane = planes_[opposite];
      plane.point = face[0];
      plane.normal = (face[1] - face[0]).cross(face[2] - face[0]);
      const double side = plane.Side(voxel_positions.row(corners[opposite]));
      plane.inner_sign = side > 0 ? 1 : (side < 0 ? -1 : 0);
      box_.extend(Eigen::Vector3d(voxel_positions.row(corners[opposite])));
    }
  }

  bool Contains(const Eigen::Vector3d& p) const {
    return std::all_of(planes_.begin(), planes_.end(), [&p](const FacePlane& plane) {
      return plane.inner_sign * plane.Side(p) >= 0;
    });
  }

  bool HasVolume() const {
    return std::all_of(planes_.begin(), planes_.end(),
                       [](const FacePlane& plane) { return plane.inner_sign != 0; });
  }

  // Voxels along an axis whose centres may lie in the tet; an empty range where it is off the grid.
  IndexRange Range(int axis, int size) const {
    const double last = size - 1;
    return {static_cast<int>(std::clamp(std::ceil(box_.min()[axis]), 0.0, last + 1)),
            static_cast<int>(std::clamp(std::floor(box_.max()[axis]), -1.0, last))};
  }

 private:
  Planes planes_;
  Eigen::AlignedBox3d box_;
};

Positions ToVoxels(const Positions& positions, const GridGeometry& grid) {
  Positions voxels(positions.rows(), 3);
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    voxels.row(v) = grid.ToVoxels(positions.row(v));
  }
  return voxels;
}

}  // namespace

// A centre on a shared face must count once. Both tets of a face see its plane with the same
// numbers, so it is in at least one of them, never in none by rounding; `taken` gives it to the
// first.
void ForEachVoxelInTets(const TetMesh& mesh, const GridGeometry& grid,
                        const std::function<void(Eigen::Index tet, int x, int y, int z)>& visit) {
  const Positions voxel_positions = ToVoxels(mesh.positions(), grid);
  std::vector<bool> taken(static_cast<size_t>(grid.num_voxels()), false);
  for (Eigen::Index tet = 0; tet < mesh.num_tets(); ++tet) {
    const TetShape shape(voxel_positions, mesh.tets(), tet);
    if (!shape.HasVolume()) continue;
    const auto [first_x, last_x] = shape.Range(0, grid.size[0]);
    const auto [first_y, last_y] = shape.Range(1, grid.size[1]);
    const auto [first_z, last_z] = shape.Range(2, grid.size[2]);
    for (int z = first_z; z <= last_z; ++z) {
      for (int y = first_y; y <= last_y; ++y) {
        for (int x = first_x; x <= last_x; ++x) {
          const auto index = static_cast<size_t>(grid.Index(x, y, z));
          if (taken[index] || !shape.Contains({double(x), double(y), double(z)})) continue;
          taken[index] = true;
          visit(tet, x, y, z);
        }
      }
    }
  }
}

}  // namespace tissueform
