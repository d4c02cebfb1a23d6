// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/legacy_vtk_reader.h"

#include <vtkCellData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridReader.h>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/readers/vtk_arrays.h"
#include "core/mesh/readers/vtk_error_scope.h"

namespace tissueform {
namespace {

// By default VTK reads the first array of each kind only.
void KeepAllArrays(vtkUnstructuredGridReader* reader) {
  reader->ReadAllScalarsOn();
  reader->ReadAllVectorsOn();
  reader->ReadAllNormalsOn();
  reader->ReadAllTensorsOn();
  reader->ReadAllColorScalarsOn();
  reader->ReadAllTCoordsOn();
  reader->ReadAllFieldsOn();
}

}  // namespace

absl::StatusOr<RawMesh> ReadLegacyVtk(const CheckedMeshFile& file) {
  VtkErrorScope errors;
  vtkNew<vtkUnstructuredGridReader> reader;
  reader->SetFileName(file.path.c_str());
  KeepAllArrays(reader);
  if (reader->IsFileUnstructuredGrid() == 0) {
    return absl::InvalidArgumentError("it holds another data set than an unstructured grid");
  }
  reader->Update();
  if (!errors.first_error().empty() || reader->GetErrorCode() != 0) {
    return absl::InvalidArgumentError(absl::StrCat("it is damaged (", errors.first_error(), ")"));
  }
  return CopyTetGrid(reader->GetOutput());
}

}  // namespace tissueform
