// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/mesh_io/raw_mesh.h"

namespace tissueform {

// A mesh, or the error instead of it, from one process to another through the file descriptors of a
// pipe. Internal to core/mesh_io.
//
// False when the reader has gone away.
bool SendRawMesh(int descriptor, const absl::StatusOr<RawMesh>& mesh);

// What SendRawMesh has sent. DataLoss when the sender ended in the middle or sent what it never
// would; nothing larger than `max_bytes` is taken (ResourceExhausted).
absl::StatusOr<RawMesh> ReceiveRawMesh(int descriptor, int64_t max_bytes);

}  // namespace tissueform
