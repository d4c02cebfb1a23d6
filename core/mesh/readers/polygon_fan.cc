// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/polygon_fan.h"

#include <limits>

#include "absl/strings/str_cat.h"

namespace tissueform {

absl::Status PolygonFan::Add(absl::Span<const int64_t> corners) {
  if (corners.size() < 3) {
    return absl::InvalidArgumentError(
        absl::StrCat("face ", num_polygons_, " has ", corners.size(), " corners, not 3 or more"));
  }
  for (const int64_t corner : corners) {
    if (corner < 0 || corner > std::numeric_limits<int32_t>::max()) {
      return absl::InvalidArgumentError(absl::StrCat("face ", num_polygons_, " refers to vertex ",
                                                     corner, ", which cannot exist"));
    }
  }
  // Right for a convex face. Of others triangles may overlap, which is why the split faces are
  // counted and reported.
  for (size_t k = 1; k + 1 < corners.size(); ++k) {
    for (const int64_t corner : {corners[0], corners[k], corners[k + 1]}) {
      corners_.push_back(static_cast<int32_t>(corner));
    }
    polygon_of_triangle_.push_back(num_polygons_);
  }
  split_polygons_ += corners.size() > 3 ? 1 : 0;
  ++num_polygons_;
  return absl::OkStatus();
}

CellIndices PolygonFan::Triangles() const {
  return Eigen::Map<const CellIndices>(corners_.data(),
                                       static_cast<Eigen::Index>(corners_.size() / 3), 3);
}

Attribute PolygonFan::Spread(const Attribute& of_polygons) const {
  Attribute result{of_polygons.name, of_polygons.components, {}};
  std::visit(
      [&](const auto& values) {
        auto spread = std::decay_t<decltype(values)>();
        spread.reserve(polygon_of_triangle_.size() * static_cast<size_t>(result.components));
        for (const int64_t polygon : polygon_of_triangle_) {
          const auto first = values.begin() + polygon * result.components;
          spread.insert(spread.end(), first, first + result.components);
        }
        result.values = std::move(spread);
      },
      of_polygons.values);
  return result;
}

}  // namespace tissueform
