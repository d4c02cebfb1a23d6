// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/types.h"

// Displacements in about a third of the bytes of float32, for slow networks: 16 bits a coordinate,
// in steps of one size for all of them, packed by zstd. Lossy, by at most half of a step.
namespace tissueform {

struct CodedDisplacements {
  // Largest |coordinate| / 32767; 0 when nothing moves. Not finite when a displacement is not.
  double step_mm = 0;
  // One zstd frame that says its size, of all x, then all y, then all z: int16, little-endian.
  std::string bytes;
};

// Any thread; each keeps a workspace of its own.
CodedDisplacements EncodeDisplacements(const FloatPositions& displacements);

// #vertices by 3. What comes from a network is not trusted: nothing larger than the answer itself
// is allocated.
//
// Errors: DataLoss when the bytes are not those of `num_vertices` vertices, are damaged, or the
// step is no step.
absl::StatusOr<Positions> DecodeDisplacements(absl::string_view bytes, double step_mm,
                                              int64_t num_vertices);

}  // namespace tissueform
