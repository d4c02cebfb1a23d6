// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/selector.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Selection = std::vector<int32_t>;

absl::StatusOr<Selection> Select(const SelectVertices& choice, const SelectionSource& source) {
  Selection selection;
  for (const int64_t vertex : choice.vertices) {
    if (vertex < 0 || vertex >= source.positions.rows()) {
      return absl::InvalidArgumentError(
          absl::StrCat("vertex ", vertex, " does not exist; the mesh has ", source.positions.rows(),
                       " vertices (0 to ", source.positions.rows() - 1, ")"));
    }
    selection.push_back(static_cast<int32_t>(vertex));
  }
  return selection;
}

absl::StatusOr<Selection> Select(const SelectByPointData& choice, const SelectionSource& source) {
  TF_ASSIGN_OR_RETURN(const std::vector<double> values,
                      FindScalars(source.point_data, choice.name, "point"));
  Selection selection;
  // On purpose without a tolerance: the array holds labels. A NaN equals nothing.
  for (size_t v = 0; v < values.size(); ++v) {
    if (values[v] == choice.equals) selection.push_back(static_cast<int32_t>(v));
  }
  return selection;
}

absl::StatusOr<Selection> Select(const SelectBox& box, const SelectionSource& source) {
  if ((box.min_mm.array() > box.max_mm.array()).any()) {
    return absl::InvalidArgumentError("a box has min above max; swap them");
  }
  Selection selection;
  for (Eigen::Index v = 0; v < source.positions.rows(); ++v) {
    // The faces belong to the box: layers of regular meshes lie exactly on round numbers.
    const Eigen::Array3d position = source.positions.row(v).transpose().array();
    if ((position >= box.min_mm.array()).all() && (position <= box.max_mm.array()).all()) {
      selection.push_back(static_cast<int32_t>(v));
    }
  }
  return selection;
}

absl::StatusOr<Selection> SelectAny(const VertexSelector& selector, const SelectionSource& source);

absl::StatusOr<Selection> Select(const SelectUnion& parts, const SelectionSource& source) {
  Selection selection;
  for (const VertexSelector& part : parts.of) {
    TF_ASSIGN_OR_RETURN(const Selection more, SelectAny(part, source));
    selection.insert(selection.end(), more.begin(), more.end());
  }
  return selection;
}

absl::StatusOr<Selection> SelectAny(const VertexSelector& selector, const SelectionSource& source) {
  return std::visit([&source](const auto& choice) { return Select(choice, source); },
                    selector.choice);
}

std::string Extent(const Positions& positions) {
  const Eigen::RowVector3d min = positions.colwise().minCoeff();
  const Eigen::RowVector3d max = positions.colwise().maxCoeff();
  return absl::StrCat("[", min[0], ", ", min[1], ", ", min[2], "] to [", max[0], ", ", max[1], ", ",
                      max[2], "] mm");
}

}  // namespace

absl::StatusOr<std::vector<int32_t>> ResolveSelector(const VertexSelector& selector,
                                                     const SelectionSource& source,
                                                     const std::string& region) {
  absl::StatusOr<Selection> selection = SelectAny(selector, source);
  if (!selection.ok()) {
    return absl::Status(selection.status().code(),
                        absl::StrCat(region, ": ", selection.status().message()));
  }
  if (selection->empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(region, " selects no vertex; change its selector (the mesh spans ",
                     Extent(source.positions), ")"));
  }
  std::sort(selection->begin(), selection->end());
  selection->erase(std::unique(selection->begin(), selection->end()), selection->end());
  return selection;
}

SelectBox SwapToOrFromLps(CoordinateSystem system, const SelectBox& box) {
  const Eigen::Vector3d a = SignsToLps(system).cwiseProduct(box.min_mm);
  const Eigen::Vector3d b = SignsToLps(system).cwiseProduct(box.max_mm);
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

}  // namespace tissueform
