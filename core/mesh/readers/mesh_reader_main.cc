// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-mesh-reader: reads a mesh through VTK, CGAL or TetGen for another program of ours.

#include <string>
#include <vtkNew.h>
#include <vtkPLYReader.h>
#include <vtkXMLPolyDataReader.h>

#include "core/mesh/readers/cgal_surface_reader.h"
#include "core/mesh/readers/legacy_vtk_reader.h"
#include "core/mesh/readers/mesh_reader_call.h"
#include "core/mesh/readers/tetgen_reader.h"
#include "core/mesh/readers/vtk_surface_reader.h"

namespace tissueform {
namespace {

template <typename Reader>
absl::StatusOr<RawMesh> ReadSurfaceBy(const std::string& path) {
  const vtkNew<Reader> reader;
  reader->SetFileName(path.c_str());
  return ReadVtkSurface(reader);
}

absl::StatusOr<RawMesh> Read(const CheckedMeshFile& file) {
  switch (file.format) {
    case MeshFormat::kLegacyVtk:
      return ReadLegacyVtk(file);
    case MeshFormat::kTetgen:
      return ReadTetgen(file.path);
    case MeshFormat::kObj:
    case MeshFormat::kOff:
      return ReadCgalSurface(file);
    case MeshFormat::kVtp:
      return ReadSurfaceBy<vtkXMLPolyDataReader>(file.path);
    case MeshFormat::kPly:
      return ReadSurfaceBy<vtkPLYReader>(file.path);
    default:
      return absl::InternalError("this format is read by another program");
  }
}

}  // namespace
}  // namespace tissueform

int main() { return tissueform::RunMeshReader(tissueform::Read); }
