// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdint>
#include <exception>
#include <limits>
#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include "absl/strings/str_cat.h"

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mesh_io/tet_mesh_io.h"
#include "core/mesh_io/vtk_export.h"

namespace tissueform {
namespace {

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
