// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/mesh/payload/mesh_payload.h"
#include "core/mesh/tet_mesh.h"
#include "server/session/limits.h"
#include "server/store/upload_store.h"

// What the server asks of a mesh before it keeps it.
namespace tissueform {

// Before a byte of it has come.
//
// Errors: InvalidArgument (counts, names or digest that cannot be, counts that disagree with the
// bytes), ResourceExhausted (over a limit).
absl::Status CheckAnnouncedMesh(const UploadAnnouncement& mesh, const ServiceLimits& limits);

// What a mesh takes in memory while it is checked or read.
int64_t PeakBytes(const MeshPayloadShape& shape);

// The mesh of a payload, which gives its positions and tets away. Computes for a while.
//
// Errors: DataLoss (another digest), InvalidArgument (NaN, infinity, not usable).
absl::StatusOr<TetMesh> CheckArrivedMesh(const std::string& sha256, MeshPayload* payload);

}  // namespace tissueform
