// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "core/base/types.h"

namespace tissueform {

// InvalidArgument unless there is at least one vertex and one cell and every entry of `cells` (#C
// by 3 or 4) lies in [0, num_vertices). `cell_name` ("tet", "triangle") is used in the message.
template <typename CellIndices>
absl::Status CheckCellIndices(Eigen::Index num_vertices, const CellIndices& cells,
                              absl::string_view cell_name) {
  if (num_vertices == 0 || cells.rows() == 0) {
    return absl::InvalidArgumentError(absl::StrCat("mesh has ", num_vertices, " vertices and ",
                                                   cells.rows(), " ", cell_name,
                                                   "s; it needs at least one of each"));
  }
  for (Eigen::Index c = 0; c < cells.rows(); ++c) {
    for (Eigen::Index corner = 0; corner < cells.cols(); ++corner) {
      const int32_t vertex = cells(c, corner);
      if (vertex < 0 || vertex >= num_vertices) {
        return absl::InvalidArgumentError(
            absl::StrCat(cell_name, " ", c, " refers to vertex ", vertex, ", but the mesh has ",
                         num_vertices, " vertices (0 to ", num_vertices - 1,
                         "); rewrite the file from the program that made it"));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace tissueform
