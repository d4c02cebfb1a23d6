// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/vtk_arrays.h"

#include <type_traits>
#include <utility>
#include <vtkCell.h>
#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkCellTypes.h>
#include <vtkDataArray.h>
#include <vtkGenericCell.h>
#include <vtkPointData.h>
#include <vtkSmartPointer.h>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/readers/raw_mesh.h"

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

// Points, lines and faces; not what VTK knows no such cell for.
bool IsOfLowerDimension(int cell_type) {
  const auto cell = vtkSmartPointer<vtkCell>::Take(vtkGenericCell::InstantiateCell(cell_type));
  return cell != nullptr && cell->GetCellDimension() < 3;
}

// The numbers of the cells that are tets.
absl::StatusOr<std::vector<vtkIdType>> FindTets(vtkUnstructuredGrid* grid) {
  std::vector<vtkIdType> tets;
  for (vtkIdType c = 0; c < grid->GetNumberOfCells(); ++c) {
    const int type = grid->GetCellType(c);
    if (type == VTK_TETRA) {
      tets.push_back(c);
    } else if (!IsOfLowerDimension(type)) {
      return absl::InvalidArgumentError(
          absl::StrCat("cell ", c, " is a ", vtkCellTypes::GetClassNameFromTypeId(type), " (type ",
                       type, "); only linear tetrahedra (type 10) are taken"));
    }
  }
  if (tets.empty() && grid->GetNumberOfCells() > 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "it holds no tets: its ", grid->GetNumberOfCells(), " cells are points, lines or faces"));
  }
  return tets;
}

absl::StatusOr<CellIndices> CopyTets(vtkUnstructuredGrid* grid,
                                     const std::vector<vtkIdType>& cells) {
  const vtkIdType num_points = grid->GetNumberOfPoints();
  CellIndices tets(static_cast<Eigen::Index>(cells.size()), 4);
  for (Eigen::Index t = 0; t < tets.rows(); ++t) {
    vtkIdType size = 0;
    const vtkIdType* corners = nullptr;
    grid->GetCells()->GetCellAtId(cells[static_cast<size_t>(t)], size, corners);
    if (size != 4)
      return absl::InvalidArgumentError(absl::StrCat("tet ", t, " has ", size, " corners, not 4"));
    for (int corner = 0; corner < 4; ++corner) {
      if (corners[corner] < 0 || corners[corner] >= num_points) {
        return absl::InvalidArgumentError(absl::StrCat(
            "tet ", t, " refers to vertex ", corners[corner], ", but there are ", num_points));
      }
      tets(t, corner) = static_cast<int32_t>(corners[corner]);
    }
  }
  return tets;
}

// The tuples of these cells only.
void KeepTuples(const std::vector<vtkIdType>& cells, Attribute* attribute) {
  std::visit(
      [&](auto& values) {
        std::decay_t<decltype(values)> kept;
        kept.reserve(cells.size() * static_cast<size_t>(attribute->components));
        for (const vtkIdType c : cells) {
          const auto first = values.begin() + c * attribute->components;
          kept.insert(kept.end(), first, first + attribute->components);
        }
        values = std::move(kept);
      },
      attribute->values);
}

}  // namespace

Positions CopyPositions(vtkPointSet* points) {
  Positions positions(points->GetNumberOfPoints(), 3);
  for (vtkIdType v = 0; v < positions.rows(); ++v) points->GetPoint(v, positions.row(v).data());
  return positions;
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

absl::StatusOr<RawMesh> CopyTetGrid(vtkUnstructuredGrid* grid) {
  TF_ASSIGN_OR_RETURN(const std::vector<vtkIdType> tets, FindTets(grid));
  RawMesh mesh;
  TF_ASSIGN_OR_RETURN(mesh.cells, CopyTets(grid, tets));
  mesh.positions = CopyPositions(grid);
  TF_ASSIGN_OR_RETURN(mesh.point_data,
                      CopyAttributes(grid->GetPointData(), grid->GetNumberOfPoints()));
  TF_ASSIGN_OR_RETURN(mesh.cell_data,
                      CopyAttributes(grid->GetCellData(), grid->GetNumberOfCells()));
  mesh.left_out_cells = grid->GetNumberOfCells() - mesh.cells.rows();
  if (mesh.left_out_cells == 0) return mesh;
  for (Attribute& attribute : mesh.cell_data) KeepTuples(tets, &attribute);
  return mesh;
}

}  // namespace tissueform
