// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/payload/mesh_payload.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "absl/strings/str_cat.h"

#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

static_assert(std::endian::native == std::endian::little,
              "payloads are little-endian and are read without conversion");

template <typename Matrix>
absl::string_view BytesOf(const Matrix& matrix) {
  return {reinterpret_cast<const char*>(matrix.data()),
          static_cast<size_t>(matrix.size()) * sizeof(typename Matrix::Scalar)};
}

}  // namespace

int64_t MeshPayloadShape::TotalBytes() const {
  return num_vertices * 3 * int64_t{sizeof(double)} + num_tets * 4 * int64_t{sizeof(int32_t)} +
         num_tets * int64_t{sizeof(double)} * static_cast<int64_t>(cell_arrays.size());
}

std::string MeshPayloadShape::Text() const {
  std::string text =
      absl::StrCat("tissueform-mesh 1\nvertices ", num_vertices, "\ntets ", num_tets, "\n");
  for (const std::string& name : cell_arrays) {
    absl::StrAppend(&text, "cell_array ", name.size(), " ", name, "\n");
  }
  return text;
}

std::string MeshPayloadView::Sha256() const {
  const std::string text = shape.Text();
  std::vector<absl::string_view> parts = {text};
  parts.insert(parts.end(), segments.begin(), segments.end());
  return Sha256Hex(parts);
}

MeshPayloadView ViewMeshPayload(const Positions& positions, const TetIndices& tets,
                                const std::vector<CellArray>& cell_arrays) {
  MeshPayloadView view;
  view.shape.num_vertices = positions.rows();
  view.shape.num_tets = tets.rows();
  view.segments = {BytesOf(positions), BytesOf(tets)};
  for (const CellArray& array : cell_arrays) {
    view.shape.cell_arrays.push_back(array.name);
    view.segments.push_back(BytesOf(array.values));
  }
  return view;
}

MeshPayload::MeshPayload(const MeshPayloadShape& shape)
    : positions_(shape.num_vertices, 3), tets_(shape.num_tets, 4) {
  for (const std::string& name : shape.cell_arrays) {
    cell_arrays_.push_back({name, Eigen::VectorXd(shape.num_tets)});
  }
}

void MeshPayload::Write(int64_t offset, absl::string_view bytes) {
  int64_t begin = 0;  // of the segment, in the payload
  for (const absl::string_view segment : View().segments) {
    const int64_t end = begin + static_cast<int64_t>(segment.size());
    if (offset < end && !bytes.empty()) {
      const size_t count = std::min(bytes.size(), static_cast<size_t>(end - offset));
      // The view is of our own members, which this function may change.
      std::memcpy(const_cast<char*>(segment.data()) + (offset - begin), bytes.data(), count);
      bytes.remove_prefix(count);
      offset += static_cast<int64_t>(count);
    }
    begin = end;
  }
}

}  // namespace tissueform
