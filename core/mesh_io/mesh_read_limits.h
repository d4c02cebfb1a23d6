// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

namespace tissueform {

// Limits on what is read from outside. Defaults are told in docs/mesh-formats.md.
struct MeshReadLimits {
  int64_t max_file_bytes = int64_t{4} << 30;

  // For the mesh and what its reader needs beside it. A file that by its size or header needs more
  // is refused before it is tried, and a library that asks for more is stopped.
  int64_t max_memory_bytes = int64_t{16} << 30;

  // Processor time of a library that reads a file.
  int max_seconds = 600;
};

}  // namespace tissueform
