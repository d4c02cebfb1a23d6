// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <new>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/orientation.h"
#include "core/mesh_io/isolated_read.h"
#include "core/mesh_io/mesh_format.h"
#include "core/mesh_io/raw_mesh_check.h"
#include "core/mesh_io/tet_mesh_io.h"
#include "core/mesh_readers/vtu_reader.h"

namespace tissueform {
namespace {

absl::StatusOr<RawMesh> ReadRaw(const CheckedMeshFile& file, const MeshReadLimits& limits) {
  if (file.format == MeshFormat::kVtu) return ReadVtu(file, limits.max_memory_bytes);
  return ReadIsolated(file, limits);
}

absl::StatusOr<TetMeshFile> ToTetMeshFile(RawMesh raw) {
  TF_RETURN_IF_ERROR(CheckRawMesh(raw));
  TetIndices tets = raw.cells;
  const Eigen::Index reoriented = RepairOrientation(raw.positions, &tets);
  TF_ASSIGN_OR_RETURN(TetMesh mesh, TetMesh::Create(std::move(raw.positions), std::move(tets)));
  return TetMeshFile{.mesh = std::move(mesh),
                     .point_data = std::move(raw.point_data),
                     .cell_data = std::move(raw.cell_data),
                     .reoriented_tets = reoriented,
                     .left_out_cells = raw.left_out_cells};
}

}  // namespace

absl::StatusOr<TetMeshFile> ReadTetMesh(const std::string& path, const MeshReadLimits& limits) {
  TF_ASSIGN_OR_RETURN(const CheckedMeshFile file, CheckMeshFile(path, MeshKind::kTets, limits));
  try {
    absl::StatusOr<RawMesh> raw = ReadRaw(file, limits);
    if (!raw.ok()) return WithMeshName(path, raw.status());
    absl::StatusOr<TetMeshFile> mesh = ToTetMeshFile(*std::move(raw));
    if (!mesh.ok()) return WithMeshName(path, mesh.status());
    return mesh;
  } catch (const std::bad_alloc&) {
    return WithMeshName(path, absl::ResourceExhaustedError("there is not enough memory for it"));
  }
}

}  // namespace tissueform
