// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/fuzz/fuzz_target.h"

#ifndef TISSUEFORM_FUZZ_TARGET
#define TISSUEFORM_FUZZ_TARGET FuzzPlan  // for tools that look at this file outside a fuzzing build
#endif

// libFuzzer's entry; TISSUEFORM_FUZZ_TARGET is the function of fuzz_target.h that this program
// drives.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {  // NOLINT
  tissueform::fuzz::TISSUEFORM_FUZZ_TARGET(data, size);
  return 0;
}
