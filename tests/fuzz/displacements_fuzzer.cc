// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <cstdlib>

#include "core/mesh/payload/displacement_codec.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {

void FuzzDisplacements(const uint8_t* data, size_t size) {
  ByteSource source(data, size);
  const double step_mm = source.Take<float>();
  const int64_t num_vertices = source.Take<uint16_t>();
  const absl::string_view bytes = source.TakeBytes(source.left());
  const absl::StatusOr<Positions> decoded = DecodeDisplacements(bytes, step_mm, num_vertices);
  if (!decoded.ok()) return;
  if (decoded->rows() != num_vertices || !decoded->allFinite()) std::abort();
  // What was understood can be said again. Beyond float32's range it cannot.
  const FloatPositions field = decoded->cast<float>();
  if (!field.allFinite()) return;
  const CodedDisplacements again = EncodeDisplacements(field);
  if (!DecodeDisplacements(again.bytes, again.step_mm, num_vertices).ok()) std::abort();
}

}  // namespace tissueform::fuzz
