// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/mesh_surface.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

#include "core/mesh/payload/sha256.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

constexpr int kMaxSurfaceArrays = 8;
constexpr size_t kSurfaceChunkBytes = 1 << 20;

static_assert(std::endian::native == std::endian::little, "numbers are sent as they are");

template <typename Number>
void Append(Number number, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&number), sizeof(number));
}

}  // namespace

absl::StatusOr<std::vector<const CellArray*>> FindSurfaceArrays(
    const StoredMesh& mesh, const google::protobuf::RepeatedPtrField<std::string>& names) {
  if (names.size() > kMaxSurfaceArrays) {
    return absl::InvalidArgumentError(absl::StrCat("cell_arrays names ", names.size(),
                                                   " arrays; the limit is ", kMaxSurfaceArrays));
  }
  std::vector<const CellArray*> arrays;
  for (const std::string& name : names) {
    arrays.push_back(mesh.FindCellArray(name));
    if (arrays.back() != nullptr) continue;
    return absl::InvalidArgumentError(absl::StrCat("cell_arrays[", arrays.size() - 1,
                                                   "]: the mesh has no array of this name; GetMesh "
                                                   "lists them"));
  }
  return arrays;
}

int64_t SurfaceBytes(const StoredMesh& mesh, size_t num_arrays) {
  const auto num_vertices = static_cast<int64_t>(mesh.skin.size());
  return 16 * num_vertices + mesh.skin_facets.rows() * (12 + 4 * static_cast<int64_t>(num_arrays));
}

MeshSurface EncodeSurface(const StoredMesh& mesh, const std::vector<const CellArray*>& arrays) {
  MeshSurface surface;
  std::string& bytes = surface.bytes;
  bytes.reserve(static_cast<size_t>(SurfaceBytes(mesh, arrays.size())));
  for (const int32_t vertex : mesh.skin) Append(vertex, &bytes);
  for (const int32_t vertex : mesh.skin) {
    for (int axis = 0; axis < 3; ++axis) {
      Append(static_cast<float>(mesh.mesh.positions()(vertex, axis)), &bytes);
    }
  }
  for (Eigen::Index facet = 0; facet < mesh.skin_facets.rows(); ++facet) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto place =
          std::lower_bound(mesh.skin.begin(), mesh.skin.end(), mesh.skin_facets(facet, corner));
      Append(static_cast<int32_t>(place - mesh.skin.begin()), &bytes);
    }
  }
  if (!arrays.empty()) {
    const std::vector<int32_t> tets = TetsBehind(mesh.skin_facets, mesh.mesh);
    for (const CellArray* array : arrays) {
      for (const int32_t tet : tets) Append(static_cast<float>(array->values[tet]), &bytes);
    }
  }
  surface.header.set_vertex_count(static_cast<int64_t>(mesh.skin.size()));
  surface.header.set_triangle_count(mesh.skin_facets.rows());
  surface.header.set_total_bytes(static_cast<int64_t>(bytes.size()));
  surface.header.set_sha256(Sha256Hex({bytes}));
  return surface;
}

bool NextSurfaceChunk(const std::string& bytes, size_t* offset, v1::SurfaceChunk* chunk) {
  if (*offset >= bytes.size()) return false;
  const size_t size = std::min(kSurfaceChunkBytes, bytes.size() - *offset);
  chunk->set_offset(static_cast<int64_t>(*offset));
  chunk->set_data(bytes.data() + *offset, size);
  *offset += size;
  return true;
}

}  // namespace tissueform
