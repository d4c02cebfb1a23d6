// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// A VTK XML unstructured grid of linear tets, ASCII, binary or appended, compressed or not. Runs in
// this process: TetGridReader checks what VTK does not. Internal to core/mesh/readers.
//
// Errors, without the name of the file: InvalidArgument; ResourceExhausted when the counts of the
// header need more memory than `max_memory_bytes`. Never throws.
absl::StatusOr<RawMesh> ReadVtu(const CheckedMeshFile& file, int64_t max_memory_bytes);

}  // namespace tissueform
