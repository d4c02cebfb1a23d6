// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

namespace tissueform {

// What gRPC alone takes of a drag's latency, in ms for every pose: a server in this process, which
// computes nothing, answers each pose with a frame of so many bytes over loopback. Below this no
// server of frames can come.
//
// Errors: Unavailable (no port, or the stream broke).
absl::StatusOr<std::vector<double>> MeasureBareTransport(int64_t frame_bytes,
                                                         double poses_per_second, double seconds);

}  // namespace tissueform
