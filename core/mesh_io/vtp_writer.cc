// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_io/vtp_writer.h"

#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataWriter.h>

#include "core/base/status_macros.h"
#include "core/mesh_io/vtk_export.h"

namespace tissueform {

absl::StatusOr<std::string> VtpText(const TriangleMeshFile& file) {
  TF_RETURN_IF_ERROR(CheckAttributes(file.point_data, file.mesh.num_vertices()));
  TF_RETURN_IF_ERROR(CheckAttributes(file.cell_data, file.mesh.num_triangles()));
  vtkNew<vtkPolyData> surface;
  vtkNew<vtkCellArray> polygons;
  polygons->AllocateExact(file.mesh.num_triangles(), 3 * file.mesh.num_triangles());
  for (const auto& triangle : file.mesh.triangles().rowwise()) {
    polygons->InsertNextCell({triangle[0], triangle[1], triangle[2]});
  }
  surface->SetPolys(polygons);
  AddPointsAndArrays(file.mesh.positions(), file.point_data, file.cell_data, surface);
  vtkNew<vtkXMLPolyDataWriter> writer;
  return SerializeWith(writer, surface);
}

}  // namespace tissueform
