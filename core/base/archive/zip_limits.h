// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

namespace tissueform {

// Limits on a zip from outside. Defaults are stated in docs/ct-input.md.
struct ZipLimits {
  int max_files = 20000;
  int64_t max_bytes = int64_t{8} << 30;  // of all unpacked files together
  // Unpacked bytes for each byte of the zip. Counts beyond kRatioFreeBytes only, as small label
  // maps compress well.
  int64_t max_ratio = 500;
  int max_folder_depth = 16;
  int64_t max_memory_bytes = int64_t{1} << 30;  // of the process that unpacks
  int max_seconds = 300;                        // of its processor time
};

inline constexpr int64_t kRatioFreeBytes = int64_t{64} << 20;

}  // namespace tissueform
