// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_readers/vtk_arrays.h"

#include <type_traits>
#include <utility>
#include <vtkCellArray.h>
#include <vtkCellTypes.h>
#include <vtkDataArray.h>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh_readers/raw_mesh.h"

namespace tissueform {
namespace {

// The number type of fixed width that VTK's type of the platform stands for.
template <size_t Bytes, bool IsSigned>
struct IntegerOfWidth;
template <>
struct IntegerOfWidth<1, true> {
  using Type = int8_t;
};
template <>
struct IntegerOfWidth<1, false> {
  using Type = uint8_t;
};
template <>
struct IntegerOfWidth<2, true> {
  using Type = int16_t;
};
template <>
struct IntegerOfWidth<2, false> {
  using Type = uint16_t;
};
template <>
struct IntegerOfWidth<4, true> {
  using Type = int32_t;
};
template <>
struct IntegerOfWidth<4, false> {
  using Type = uint32_t;
};
template <>
struct IntegerOfWidth<8, true> {
  using Type = int64_t;
};
template <>
struct IntegerOfWidth<8, false> {
  using Type = uint64_t;
};

template <typename T>
Attribute::Values CopyValues(const T* values, vtkIdType count) {
  if constexpr (std::is_floating_point_v<T>) {
    return std::vector<T>(values, values + count);
  } else {
    using Fixed = typename IntegerOfWidth<sizeof(T), std::is_signed_v<T>>::Type;
    return std::vector<Fixed>(values, values + count);
  }
}

}  // namespace

Positions CopyPositions(vtkPointSet* points) {
  Positions positions(points->GetNumberOfPoints(), 3);
  for (vtkIdType v = 0; v < positions.rows(); ++v) points->GetPoint(v, positions.row(v).data());
  return positions;
}

absl::StatusOr<CellIndices> CopyTets(vtkUnstructuredGrid* grid) {
  const vtkIdType num_cells = grid->GetNumberOfCells();
  const vtkIdType num_points = grid->GetNumberOfPoints();
  CellIndices tets(num_cells, 4);
  for (vtkIdType c = 0; c < num_cells; ++c) {
    if (grid->GetCellType(c) != VTK_TETRA) {
      const char* type = vtkCellTypes::GetClassNameFromTypeId(grid->GetCellType(c));
      return absl::InvalidArgumentError(
          absl::StrCat("cell ", c, " is a ", type, " (type ", grid->GetCellType(c),
                       "); only linear tetrahedra (type 10) are taken"));
    }
    vtkIdType size = 0;
    const vtkIdType* corners = nullptr;
    grid->GetCells()->GetCellAtId(c, size, corners);
    if (size != 4)
      return absl::InvalidArgumentError(absl::StrCat("tet ", c, " has ", size, " corners, not 4"));
    for (int corner = 0; corner < 4; ++corner) {
      if (corners[corner] < 0 || corners[corner] >= num_points) {
        return absl::InvalidArgumentError(absl::StrCat(
            "tet ", c, " refers to vertex ", corners[corner], ", but there are ", num_points));
      }
      tets(c, corner) = static_cast<int32_t>(corners[corner]);
    }
  }
  return tets;
}

absl::StatusOr<std::vector<Attribute>> CopyAttributes(vtkFieldData* fields, vtkIdType num_tuples) {
  std::vector<Attribute> attributes;
  for (int i = 0; i < fields->GetNumberOfArrays(); ++i) {
    vtkDataArray* array = vtkDataArray::SafeDownCast(fields->GetAbstractArray(i));
    if (array == nullptr || array->GetDataType() == VTK_BIT) continue;
    if (array->GetName() == nullptr) return absl::InvalidArgumentError("an array has no name");
    TF_RETURN_IF_ERROR(CheckAttributeName(array->GetName()));
    if (array->GetNumberOfTuples() != num_tuples) {
      return absl::InvalidArgumentError(absl::StrCat("array \"", array->GetName(), "\" has ",
                                                     array->GetNumberOfTuples(), " tuples, not ",
                                                     num_tuples));
    }
    Attribute attribute{array->GetName(), array->GetNumberOfComponents(), {}};
    switch (array->GetDataType()) {
      vtkTemplateMacro(attribute.values =
                           CopyValues(static_cast<const VTK_TT*>(array->GetVoidPointer(0)),
                                      array->GetNumberOfValues()));
      default:
        continue;
    }
    attributes.push_back(std::move(attribute));
  }
  return attributes;
}

}  // namespace tissueform
