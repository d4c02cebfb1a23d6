// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "google/protobuf/repeated_field.h"

#include "server/session/mesh_catalog.h"
#include "tissueform/v1/mesh_service.pb.h"

namespace tissueform {

// What GetSurface sends of a mesh.
struct MeshSurface {
  v1::SurfaceHeader header;
  std::string bytes;  // SurfaceHeader defines their order
};

// The arrays of these names. Errors: InvalidArgument (the mesh has no such one, or they are more
// than may be).
absl::StatusOr<std::vector<const CellArray*>> FindSurfaceArrays(
    const StoredMesh& mesh, const google::protobuf::RepeatedPtrField<std::string>& names);

// MeshSurface::bytes.size(), known before they are made.
int64_t SurfaceBytes(const StoredMesh& mesh, size_t num_arrays);
// Computes for some milliseconds: on a worker.
MeshSurface EncodeSurface(const StoredMesh& mesh, const std::vector<const CellArray*>& arrays);

// Puts the part of the bytes that begins at `*offset` into `chunk`, and `*offset` behind it. False
// when nothing is left.
bool NextSurfaceChunk(const std::string& bytes, size_t* offset, v1::SurfaceChunk* chunk);

}  // namespace tissueform
