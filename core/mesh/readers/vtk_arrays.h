// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>
#include <vtkFieldData.h>
#include <vtkPointSet.h>
#include <vtkUnstructuredGrid.h>

#include "absl/status/statusor.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// What VTK holds, as ours. Internal to core/mesh/readers. Errors are InvalidArgument without the
// name of the file.

Positions CopyPositions(vtkPointSet* points);

// The linear tets, all points and all numeric arrays. Points, lines and faces, which meshers lay
// beside the tets of a volume, are left out with their values and counted; vertices that only they
// use stay, so that the numbers of the file still hold. An error where another cell has volume,
// where there are only cells without, or where a tet names a vertex that is not there.
absl::StatusOr<RawMesh> CopyTetGrid(vtkUnstructuredGrid* grid);

// Every numeric array; an error where one has other than `num_tuples` tuples. Arrays that hold no
// numbers (texts, bits) are left out.
absl::StatusOr<std::vector<Attribute>> CopyAttributes(vtkFieldData* fields, vtkIdType num_tuples);

}  // namespace tissueform
