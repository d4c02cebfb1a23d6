// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/tet_mesh_io.h"

#include <exception>
#include <limits>
#include <new>
#include <utility>
#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include "absl/strings/str_cat.h"

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/io/isolated_read.h"
#include "core/mesh/io/mesh_format.h"
#include "core/mesh/io/raw_mesh_check.h"
#include "core/mesh/io/vtk_export.h"
#include "core/mesh/readers/vtu_reader.h"
#include "core/mesh/tet_quality.h"

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

void AddTets(const TetIndices& tets, vtkUnstructuredGrid* grid) {
  vtkNew<vtkCellArray> cells;
  // Half the bytes to compress; our indices are no longer.
  if (4 * tets.rows() <= std::numeric_limits<int32_t>::max()) cells->Use32BitStorage();
  cells->AllocateExact(tets.rows(), 4 * tets.rows());
  for (const auto& tet : tets.rowwise()) {
    cells->InsertNextCell({tet[0], tet[1], tet[2], tet[3]});
  }
  grid->SetCells(VTK_TETRA, cells);
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

absl::Status WriteTetMesh(const std::string& path, const TetMeshFile& file) {
  TF_RETURN_IF_ERROR(CheckAttributes(file.point_data, file.mesh.num_vertices()));
  TF_RETURN_IF_ERROR(CheckAttributes(file.cell_data, file.mesh.num_tets()));
  try {
    vtkNew<vtkUnstructuredGrid> grid;
    AddTets(file.mesh.tets(), grid);
    AddPointsAndArrays(file.mesh.positions(), file.point_data, file.cell_data, grid);
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    TF_ASSIGN_OR_RETURN(const std::string contents, SerializeWith(writer, grid));
    return WriteFileAtomically(path, contents);
  } catch (const std::exception& exception) {
    return absl::ResourceExhaustedError(
        absl::StrCat("cannot write mesh ", path, ": ", exception.what()));
  }
}

}  // namespace tissueform
