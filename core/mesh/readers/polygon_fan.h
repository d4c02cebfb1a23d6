// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"

#include "core/mesh/attribute.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// Splits polygons into triangles, each polygon as a fan round its first corner. Internal to
// core/mesh/readers.
class PolygonFan {
 public:
  // InvalidArgument for less than three corners or an index that 32 bits do not hold.
  absl::Status Add(absl::Span<const int64_t> corners);

  CellIndices Triangles() const;  // #F by 3, in the order of the polygons

  // How many polygons had more than three corners.
  int64_t split_polygons() const { return split_polygons_; }

  // An array with one tuple a polygon as one with one tuple a triangle.
  Attribute Spread(const Attribute& of_polygons) const;

 private:
  std::vector<int32_t> corners_;  // three a triangle
  std::vector<int64_t> polygon_of_triangle_;
  int64_t num_polygons_ = 0;
  int64_t split_polygons_ = 0;
};

}  // namespace tissueform
