// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/mesh_conversion.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

constexpr absl::string_view kMeshPrefix = "meshes/";

}  // namespace

std::string MeshName(absl::string_view sha256) { return absl::StrCat(kMeshPrefix, sha256); }

absl::StatusOr<std::string> ParseMeshName(absl::string_view name) {
  if (!absl::ConsumePrefix(&name, kMeshPrefix) || !IsSha256Hex(name)) {
    return absl::InvalidArgumentError(
        "invalid mesh name; use \"meshes/\" and 64 lower-case hexadecimal digits");
  }
  return std::string(name);
}

v1::MeshHeader ToProto(const MeshPayloadShape& shape, const std::string& sha256) {
  v1::MeshHeader header;
  header.set_vertex_count(shape.num_vertices);
  header.set_tet_count(shape.num_tets);
  header.mutable_cell_arrays()->Add(shape.cell_arrays.begin(), shape.cell_arrays.end());
  header.set_total_bytes(shape.TotalBytes());
  header.set_sha256(sha256);
  return header;
}

MeshPayloadShape ToPayloadShape(const v1::MeshHeader& header) {
  MeshPayloadShape shape;
  shape.num_vertices = header.vertex_count();
  shape.num_tets = header.tet_count();
  shape.cell_arrays = {header.cell_arrays().begin(), header.cell_arrays().end()};
  return shape;
}

}  // namespace tissueform
