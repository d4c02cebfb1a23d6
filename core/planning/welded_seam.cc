// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/welded_seam.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/constraints/doubled_vertices.h"

namespace tissueform {
namespace {

// The number of vertices without the doubles.
absl::StatusOr<int32_t> NumKept(const std::vector<int32_t>& first) {
  const auto num_vertices = static_cast<int32_t>(first.size());
  int32_t kept = num_vertices;
  while (kept > 0 && first[static_cast<size_t>(kept) - 1] != kept - 1) --kept;
  for (int32_t vertex = 0; vertex < kept; ++vertex) {
    if (first[static_cast<size_t>(vertex)] == vertex) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "the lips cannot be joined: vertex ", vertex, " doubles vertex ",
        first[static_cast<size_t>(vertex)], " and is not among the last vertices (vertex ",
        kept - 1, " is not a double); number the seam's doubles last, or keep contact on"));
  }
  return kept;
}

absl::StatusOr<TetIndices> WeldTets(const TetIndices& tets, const std::vector<int32_t>& first) {
  TetIndices welded = tets;
  for (Eigen::Index t = 0; t < welded.rows(); ++t) {
    for (int corner = 0; corner < 4; ++corner) {
      welded(t, corner) = first[static_cast<size_t>(tets(t, corner))];
      for (int before = 0; before < corner; ++before) {
        if (welded(t, before) != welded(t, corner)) continue;
        return absl::InvalidArgumentError(
            absl::StrCat("the lips cannot be joined: tet ", t, " has vertices ", tets(t, before),
                         " and ", tets(t, corner), ", which are at one place; keep contact on"));
      }
    }
  }
  return welded;
}

}  // namespace

absl::StatusOr<TetMeshFile> WeldSeam(TetMeshFile file, const std::vector<ContactRow>& rows) {
  TF_ASSIGN_OR_RETURN(const std::vector<int32_t> first, FirstAtPlace(file.mesh.positions(), rows));
  TF_ASSIGN_OR_RETURN(const int32_t kept, NumKept(first));
  if (kept == file.mesh.num_vertices()) return file;
  TF_ASSIGN_OR_RETURN(TetIndices tets, WeldTets(file.mesh.tets(), first));
  TF_ASSIGN_OR_RETURN(
      file.mesh, TetMesh::Create(Positions(file.mesh.positions().topRows(kept)), std::move(tets)));
  for (Attribute& array : file.point_data) {
    const size_t size = static_cast<size_t>(kept) * static_cast<size_t>(array.components);
    std::visit([size](auto& values) { values.resize(size); }, array.values);
  }
  return file;
}

}  // namespace tissueform
