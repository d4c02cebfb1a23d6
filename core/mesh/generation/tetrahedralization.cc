// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/tetrahedralization.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/process/pipe_stream.h"
#include "core/base/status_macros.h"
#include "core/mesh/generation/cavities.h"
#include "core/mesh/generation/surface_defects.h"
#include "core/mesh/generation/tetgen_call.h"
#include "core/mesh/tet_quality.h"

namespace tissueform {
namespace {

absl::Status CheckOptions(const TriangleMesh& surface, const TetrahedralizationOptions& options) {
  // Written so that NaN is refused too.
  if (!(options.max_radius_edge_ratio >= 1.1 && options.max_radius_edge_ratio <= 100)) {
    return absl::InvalidArgumentError(absl::StrCat("radius-edge ratio ",
                                                   options.max_radius_edge_ratio,
                                                   " is not between 1.1 and 100; try 1.4"));
  }
  if (!(options.min_dihedral_deg >= 0 && options.min_dihedral_deg <= 18)) {
    return absl::InvalidArgumentError(absl::StrCat("smallest dihedral angle ",
                                                   options.min_dihedral_deg,
                                                   " is not between 0 and 18 degrees; try 10"));
  }
  if (!(options.max_tet_volume_mm3 >= 0)) {
    return absl::InvalidArgumentError("largest volume of a tet is negative; 0 means no limit");
  }
  if (!options.edge_lengths_mm.empty() &&
      static_cast<Eigen::Index>(options.edge_lengths_mm.size()) != surface.num_vertices()) {
    return absl::InvalidArgumentError(absl::StrCat(options.edge_lengths_mm.size(),
                                                   " edge lengths for ", surface.num_vertices(),
                                                   " vertices of the surface; give one for each"));
  }
  return absl::OkStatus();
}

// Leaves out the vertices that no tet holds: those that lie exactly on another one.
absl::Status DropUnusedVertices(RawTets* raw) {
  std::vector<int32_t> number(static_cast<size_t>(raw->positions.rows()), -1);
  for (const int32_t v : raw->tets.reshaped<Eigen::RowMajor>()) {
    if (v < 0 || v >= raw->positions.rows()) return PipeReceiver::BrokenOff();
    number[v] = 0;
  }
  int32_t used = 0;
  for (size_t v = 0; v < number.size(); ++v) {
    if (number[v] < 0) continue;
    raw->positions.row(used) = raw->positions.row(static_cast<Eigen::Index>(v)).eval();
    number[v] = used++;
  }
  raw->positions.conservativeResize(used, 3);
  for (int32_t& v : raw->tets.reshaped<Eigen::RowMajor>()) v = number[v];
  return absl::OkStatus();
}

}  // namespace

double RegularTetVolume(double edge_mm) {
  return edge_mm * edge_mm * edge_mm / (6 * std::sqrt(2.0));
}

absl::StatusOr<Tetrahedralization> Tetrahedralize(const TriangleMesh& surface,
                                                  const TetrahedralizationOptions& options) {
  TF_RETURN_IF_ERROR(CheckOptions(surface, options));
  TF_RETURN_IF_ERROR(CheckMeshable(FindSurfaceDefects(surface)));
  std::vector<Eigen::Vector3d> holes_mm = CavityPoints(surface);
  holes_mm.insert(holes_mm.end(), options.holes_mm.begin(), options.holes_mm.end());
  TF_ASSIGN_OR_RETURN(RawTets raw, CallTetgen(surface, holes_mm, options));
  TF_RETURN_IF_ERROR(DropUnusedVertices(&raw));
  RepairOrientation(raw.positions, &raw.tets);
  const Eigen::VectorXd volumes = TetVolumes(raw.positions, raw.tets);
  if (volumes.minCoeff() <= 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "TetGen leaves ", (volumes.array() <= 0).count(), " tets without volume (tet ",
        std::distance(volumes.begin(), std::min_element(volumes.begin(), volumes.end())),
        "); remesh the surface"));
  }
  std::vector<int32_t> region_of_tet;
  for (const double attribute : raw.attributes) {
    region_of_tet.push_back(static_cast<int32_t>(attribute));
  }
  TF_ASSIGN_OR_RETURN(TetMesh mesh, TetMesh::Create(std::move(raw.positions), std::move(raw.tets)));
  return Tetrahedralization{std::move(mesh), std::move(region_of_tet)};
}

}  // namespace tissueform
