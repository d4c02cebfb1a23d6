// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/surface_extraction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>
#include <vtkCellArray.h>
#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>

#include <SMP/Common/vtkSMPToolsAPI.h>

#include "core/base/status_macros.h"
#include "core/mesh/surface_parts.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

absl::Status CheckGrid(const VoxelGrid<float>& grid, float level) {
  const auto size = grid.geometry.size;
  if (*std::min_element(size.begin(), size.end()) < 1 ||
      static_cast<int64_t>(grid.values.size()) != grid.geometry.num_voxels()) {
    return absl::InvalidArgumentError("a grid whose size and values disagree has no surface");
  }
  const auto is_finite = [](float value) { return std::isfinite(value); };
  if (!std::all_of(grid.values.begin(), grid.values.end(), is_finite)) {
    return absl::InvalidArgumentError("a grid with values that are not finite has no surface");
  }
  if (*std::max_element(grid.values.begin(), grid.values.end()) <= level) {
    return absl::InvalidArgumentError("no voxel of the grid is inside; there is no surface");
  }
  return absl::OkStatus();
}

// A value on the level itself, or nearly, puts a vertex of marching cubes on a corner of its cube:
// triangles without area, and walls that touch. Kept off by this, no triangle collapses, and the
// surface moves by less than that part of a voxel.
// Wide enough for single precision to distinguish the level from its neighbors.
float Clearance(const VoxelGrid<float>& grid, const SurfaceExtractionOptions& options) {
  float largest = 0;
  for (const float value : grid.values) {
    largest = std::max(largest, std::abs(value - options.level));
  }
  return std::max(options.clearance, 1e-5F * largest);
}

// `grid` with one more layer all round, in which what is inside at the border is mirrored to the
// outside.
VoxelGrid<float> Padded(const VoxelGrid<float>& grid, float level, float clearance) {
  GridGeometry geometry = grid.geometry;
  for (int& size : geometry.size) size += 2;
  geometry.origin_mm.array() -= geometry.spacing_mm;
  VoxelGrid<float> padded(geometry);
  const auto [nx, ny, nz] = geometry.size;
  for (int z = 0; z < nz; ++z) {
    for (int y = 0; y < ny; ++y) {
      for (int x = 0; x < nx; ++x) {
        const int inner_x = std::clamp(x - 1, 0, nx - 3);
        const int inner_y = std::clamp(y - 1, 0, ny - 3);
        const int inner_z = std::clamp(z - 1, 0, nz - 3);
        const bool is_padding = x != inner_x + 1 || y != inner_y + 1 || z != inner_z + 1;
        const float height = grid.At(inner_x, inner_y, inner_z) - level;
        const float clear = std::max(std::abs(height), clearance);
        padded.At(x, y, z) = height > 0 && !is_padding ? clear : -clear;
      }
    }
  }
  return padded;
}

// Vertices in voxels, in the order of VTK.
TriangleMesh ToTriangleMesh(vtkPolyData* surface, const GridGeometry& geometry) {
  Positions positions(surface->GetNumberOfPoints(), 3);
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    std::array<double, 3> voxels{};
    surface->GetPoint(v, voxels.data());
    positions.row(v) =
        (geometry.origin_mm + geometry.spacing_mm * Vector3d(voxels[0], voxels[1], voxels[2]))
            .transpose();
  }
  TriangleIndices triangles(surface->GetNumberOfPolys(), 3);
  vtkCellArray* polygons = surface->GetPolys();
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    vtkIdType count = 0;
    const vtkIdType* corners = nullptr;
    polygons->GetCellAtId(f, count, corners);
    for (int k = 0; k < 3; ++k) triangles(f, k) = static_cast<int32_t>(corners[k]);
  }
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

// The surface of height 0. In units of voxels, because VTK's coordinates have single precision.
TriangleMesh ZeroSurface(VoxelGrid<float>* heights) {
  vtkNew<vtkFloatArray> values;
  values->SetArray(heights->values.data(), heights->geometry.num_voxels(), 1);
  vtkNew<vtkImageData> image;
  image->SetDimensions(heights->geometry.size.data());
  image->GetPointData()->SetScalars(values);
  vtkNew<vtkFlyingEdges3D> edges;
  edges->SetInputData(image);
  edges->SetValue(0, 0.0);
  edges->ComputeNormalsOff();
  edges->ComputeGradientsOff();
  edges->ComputeScalarsOff();
  // TBB's threads would stay, and a process with threads is no good parent for a child without
  // exec. Not through vtkSMPTools.h: VTK 9.1's is no C++20.
  vtk::detail::smp::vtkSMPToolsAPI::GetInstance().SetBackend("Sequential");
  edges->Update();
  return ToTriangleMesh(edges->GetOutput(), heights->geometry);
}

// A vertex of every part.
std::vector<int32_t> PlacesOf(const TriangleMesh& surface, const SurfaceParts& parts) {
  std::vector<int32_t> places(parts.volumes_mm3.size());
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    places[parts.part_of_triangle[f]] = surface.triangles()(f, 0);
  }
  return places;
}

// Which parts are the outermost wall of the largest volume, of another that is large enough, or a
// cavity of one of them. Cavities from the largest down, so that one that floats inside another is
// recognised.
std::vector<bool> KeptParts(const TriangleMesh& surface, const SurfaceParts& parts,
                            const SurfaceExtractionOptions& options) {
  const std::vector<double>& volumes = parts.volumes_mm3;
  const std::vector<int32_t> places = PlacesOf(surface, parts);
  std::vector<int32_t> order(volumes.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int32_t a, int32_t b) { return volumes[a] < volumes[b]; });
  std::vector<bool> kept(volumes.size());
  for (const int32_t part : order) kept[part] = volumes[part] >= options.min_part_volume_mm3;
  kept[order.back()] = true;
  for (const int32_t part : order) {
    if (volumes[part] >= 0 || -volumes[part] < options.min_cavity_volume_mm3) break;
    const Vector3d place = surface.positions().row(places[part]).transpose();
    kept[part] = WindingNumber(surface, parts, kept, place) > 0.5;
  }
  return kept;
}

}  // namespace

absl::StatusOr<TriangleMesh> ExtractSurface(const VoxelGrid<float>& grid,
                                            const SurfaceExtractionOptions& options) {
  TF_RETURN_IF_ERROR(CheckGrid(grid, options.level));
  VoxelGrid<float> heights = Padded(grid, options.level, Clearance(grid, options));
  const TriangleMesh surface = ZeroSurface(&heights);
  const SurfaceParts parts = FindSurfaceParts(surface);
  return KeepParts(surface, parts, KeptParts(surface, parts, options));
}

}  // namespace tissueform
