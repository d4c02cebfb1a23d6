// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/freed_memory.h"

#include <malloc.h>

namespace tissueform {

void ReturnFreedMemory() {
  constexpr int kSmallestBytes = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, kSmallestBytes);
}

}  // namespace tissueform
