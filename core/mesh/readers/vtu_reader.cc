// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/vtu_reader.h"

#include <utility>
#include <vtkCellData.h>
#include <vtkNew.h>
#include <vtkPointData.h>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/readers/tet_grid_reader.h"
#include "core/mesh/readers/vtk_arrays.h"
#include "core/mesh/readers/vtk_error_scope.h"

namespace tissueform {
namespace {

// Runs VTK over the file. Anything it reports, and anything it ought to have reported, is an error.
absl::Status ReadGrid(const CheckedMeshFile& file, TetGridReader* reader) {
  VtkErrorScope errors;
  reader->SetFileName(file.path.c_str());
  reader->set_file_bytes(file.bytes);
  try {
    reader->Update();
  } catch (const std::exception& exception) {
    return absl::InvalidArgumentError(
        absl::StrCat("VTK's reader gave up (", exception.what(), ")"));
  }
  if (reader->is_over_memory()) return absl::ResourceExhaustedError(reader->defect());
  if (!reader->defect().empty()) return absl::InvalidArgumentError(reader->defect());
  if (!errors.first_error().empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("it is damaged or not a .vtu file (", errors.first_error(), ")"));
  }
  if (reader->GetErrorCode() != 0)
    return absl::InvalidArgumentError("it is damaged or not a .vtu file");
  return absl::OkStatus();
}

// The counts that the header announced are those that arrived.
absl::Status CheckCounts(TetGridReader* reader) {
  vtkUnstructuredGrid* grid = reader->GetOutput();
  if (grid->GetPoints() == nullptr || grid->GetNumberOfPoints() != reader->GetNumberOfPoints() ||
      grid->GetNumberOfCells() != reader->GetNumberOfCells()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "its header says ", reader->GetNumberOfPoints(), " points and ", reader->GetNumberOfCells(),
        " cells, its arrays hold ", grid->GetNumberOfPoints(), " and ", grid->GetNumberOfCells()));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RawMesh> ReadVtu(const CheckedMeshFile& file, int64_t max_memory_bytes) {
  vtkNew<TetGridReader> reader;
  reader->set_max_memory_bytes(max_memory_bytes);
  TF_RETURN_IF_ERROR(ReadGrid(file, reader));
  TF_RETURN_IF_ERROR(CheckCounts(reader));
  return CopyTetGrid(reader->GetOutput());
}

}  // namespace tissueform
