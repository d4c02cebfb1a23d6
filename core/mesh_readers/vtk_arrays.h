// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>
#include <vtkFieldData.h>
#include <vtkPointSet.h>
#include <vtkUnstructuredGrid.h>

#include "absl/status/statusor.h"

#include "core/mesh_readers/raw_mesh.h"

namespace tissueform {

// What VTK holds, as ours. Internal to core/mesh_readers. Errors are InvalidArgument without the
// name of the file.

Positions CopyPositions(vtkPointSet* points);

// #C by 4. An error where a cell is no linear tet or names a vertex that is not there.
absl::StatusOr<CellIndices> CopyTets(vtkUnstructuredGrid* grid);

// Every numeric array; an error where one has other than `num_tuples` tuples. Arrays that hold no
// numbers (texts, bits) are left out.
absl::StatusOr<std::vector<Attribute>> CopyAttributes(vtkFieldData* fields, vtkIdType num_tuples);

}  // namespace tissueform
