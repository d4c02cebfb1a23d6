// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/bar_mesh.h"

#include <cstdint>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Round the diagonal from corner 0 to corner 7; corner bits are x, y, z.
constexpr int kCellTets[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                 {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};

absl::Status CheckPlanes(const std::vector<double>& planes, absl::string_view axis) {
  if (planes.size() < 2) {
    return absl::InvalidArgumentError(absl::StrCat("grid has ", planes.size(), " planes across ",
                                                   axis, "; it needs at least two"));
  }
  for (size_t p = 1; p < planes.size(); ++p) {
    if (!(planes[p] > planes[p - 1])) {
      return absl::InvalidArgumentError(absl::StrCat("plane ", p, " across ", axis, " at ",
                                                     planes[p], " mm is not above plane ", p - 1,
                                                     " at ", planes[p - 1], " mm"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckGrid(const GridPlanes& planes) {
  TF_RETURN_IF_ERROR(CheckPlanes(planes.x, "x"));
  TF_RETURN_IF_ERROR(CheckPlanes(planes.y, "y"));
  TF_RETURN_IF_ERROR(CheckPlanes(planes.z, "z"));
  const double vertices = static_cast<double>(planes.x.size()) *
                          static_cast<double>(planes.y.size()) *
                          static_cast<double>(planes.z.size());
  if (vertices > std::numeric_limits<int32_t>::max()) {
    return absl::InvalidArgumentError(
        absl::StrCat("grid has ", vertices, " vertices; take fewer planes"));
  }
  return absl::OkStatus();
}

Positions GridPositions(const GridPlanes& planes) {
  Positions positions(
      static_cast<Eigen::Index>(planes.x.size() * planes.y.size() * planes.z.size()), 3);
  Eigen::Index vertex = 0;
  for (const double z : planes.z) {
    for (const double y : planes.y) {
      for (const double x : planes.x) {
        positions.row(vertex++) << x, y, z;
      }
    }
  }
  return positions;
}

TetIndices GridTets(int nx, int ny, int nz) {
  TetIndices tets(Eigen::Index{6} * nx * ny * nz, 4);
  Eigen::Index row = 0;
  for (int k = 0; k < nz; ++k) {
    for (int j = 0; j < ny; ++j) {
      for (int i = 0; i < nx; ++i) {
        for (const auto& tet : kCellTets) {
          for (int corner = 0; corner < 4; ++corner) {
            const int bits = tet[corner];
            tets(row, corner) = i + (bits & 1) +
                                (nx + 1) * (j + (bits >> 1 & 1) + (ny + 1) * (k + (bits >> 2 & 1)));
          }
          ++row;
        }
      }
    }
  }
  return tets;
}

}  // namespace

std::vector<double> EvenPlanes(double begin_mm, double end_mm, int cells) {
  std::vector<double> planes;
  for (int p = 0; p <= cells; ++p) {
    planes.push_back(p == cells ? end_mm : begin_mm + (end_mm - begin_mm) * p / cells);
  }
  return planes;
}

GridPlanes CubeGrid(const std::array<int, 3>& cells, double cell_mm) {
  return {EvenPlanes(0, cell_mm * cells[0], cells[0]), EvenPlanes(0, cell_mm * cells[1], cells[1]),
          EvenPlanes(0, cell_mm * cells[2], cells[2])};
}

absl::StatusOr<TetMesh> BarMesh(const GridPlanes& planes) {
  TF_RETURN_IF_ERROR(CheckGrid(planes));
  return TetMesh::Create(GridPositions(planes), GridTets(static_cast<int>(planes.x.size()) - 1,
                                                         static_cast<int>(planes.y.size()) - 1,
                                                         static_cast<int>(planes.z.size()) - 1));
}

}  // namespace tissueform
