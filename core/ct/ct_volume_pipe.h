// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/ct/ct_volume.h"

namespace tissueform {

// Writes a volume, or why there is none, into the pipe of RunIsolated; false when the reader has
// gone away. Internal to core/ct.
bool SendCtVolume(int descriptor, const absl::StatusOr<CtVolume>& volume);

// Reads it. DataLoss when the sender ended in the middle or sent what it never would;
// ResourceExhausted when the volume has more than `max_voxels`.
absl::StatusOr<CtVolume> ReceiveCtVolume(int descriptor, int64_t max_voxels);

}  // namespace tissueform
