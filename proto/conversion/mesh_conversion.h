// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/mesh/payload/mesh_payload.h"
#include "tissueform/v1/mesh_service.pb.h"

namespace tissueform {

// "meshes/{sha256}" from the digest and back. Errors: InvalidArgument.
std::string MeshName(absl::string_view sha256);
absl::StatusOr<std::string> ParseMeshName(absl::string_view name);

// What is said of a mesh before it is sent. The shape is checked by who receives the mesh.
v1::MeshHeader ToProto(const MeshPayloadShape& shape, const std::string& sha256);
MeshPayloadShape ToPayloadShape(const v1::MeshHeader& header);

}  // namespace tissueform
