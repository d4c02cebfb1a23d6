// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-stl-reader: reads an STL file through VTK for another program of ours.

#include <vtkNew.h>
#include <vtkSTLReader.h>

#include "core/mesh/readers/mesh_reader_call.h"
#include "core/mesh/readers/vtk_surface_reader.h"

int main() {
  return tissueform::RunMeshReader([](const tissueform::CheckedMeshFile& file) {
    const vtkNew<vtkSTLReader> reader;
    reader->SetFileName(file.path.c_str());
    return tissueform::ReadVtkSurface(reader);
  });
}
