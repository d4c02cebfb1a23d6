// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/mesh/io/tet_mesh_io.h"
#include "core/planning/plan.h"

namespace tissueform {

// The ending of a case (docs/case-format.md), which a plan may name as its mesh.
inline constexpr char kCaseEnding[] = ".tfcase";

// The tet mesh in a case with its cell arrays, LPS. A case holds no point arrays.
//
// Errors: those of ReadCase and TetMesh::Create.
absl::StatusOr<TetMeshFile> ReadMeshOfCase(const std::string& path);

// Vertex numbers mean nothing in another mesh: where the plan says a digest, the mesh has to have
// it. `file` is in the plan's coordinate system.
//
// Errors: InvalidArgument, also those of ResolveStiffness.
absl::Status CheckMeshDigest(const Plan& plan, const TetMeshFile& file);

}  // namespace tissueform
