// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/vtk_surface_reader.h"

#include <vtkCellData.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/readers/polygon_fan.h"
#include "core/mesh/readers/vtk_arrays.h"
#include "core/mesh/readers/vtk_error_scope.h"

namespace tissueform {
namespace {

// The triangles of all polygons, and the cell data that each of them inherits.
absl::Status CopyPolygons(vtkPolyData* surface, RawMesh* mesh) {
  if (surface->GetNumberOfStrips() != 0 || surface->GetNumberOfVerts() != 0 ||
      surface->GetNumberOfLines() != 0) {
    return absl::InvalidArgumentError(
        "it holds points, lines or strips beside polygons; save the triangles only");
  }
  PolygonFan fan;
  for (vtkIdType c = 0; c < surface->GetNumberOfPolys(); ++c) {
    vtkIdType size = 0;
    const vtkIdType* corners = nullptr;
    surface->GetPolys()->GetCellAtId(c, size, corners);
    TF_RETURN_IF_ERROR(fan.Add(std::vector<int64_t>(corners, corners + size)));
  }
  TF_ASSIGN_OR_RETURN(std::vector<Attribute> of_polygons,
                      CopyAttributes(surface->GetCellData(), surface->GetNumberOfCells()));
  for (Attribute& attribute : of_polygons) mesh->cell_data.push_back(fan.Spread(attribute));
  mesh->cells = fan.Triangles();
  mesh->split_polygons = fan.split_polygons();
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RawMesh> ReadVtkSurface(vtkAlgorithm* reader) {
  VtkErrorScope errors;
  reader->Update();
  if (!errors.first_error().empty() || reader->GetErrorCode() != 0) {
    return absl::InvalidArgumentError(absl::StrCat("it is damaged (", errors.first_error(), ")"));
  }
  auto* const surface = vtkPolyData::SafeDownCast(reader->GetOutputDataObject(0));
  RawMesh mesh;
  mesh.positions = CopyPositions(surface);
  TF_RETURN_IF_ERROR(CopyPolygons(surface, &mesh));
  TF_ASSIGN_OR_RETURN(mesh.point_data,
                      CopyAttributes(surface->GetPointData(), surface->GetNumberOfPoints()));
  return mesh;
}

}  // namespace tissueform
