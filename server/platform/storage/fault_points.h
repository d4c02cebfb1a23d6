// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>

// Places in the write path at which a test may end the process. Without TISSUEFORM_FAULT_POINTS,
// which builds with tests set for this library, nothing of them is compiled.
#ifdef TISSUEFORM_FAULT_POINTS
#define TF_FAULT_POINT(name) ::tissueform::PassFaultPoint(name)
#else
#define TF_FAULT_POINT(name) static_cast<void>(0)
#endif

namespace tissueform {

// What a test does at a place; null: nothing. Called on the thread that passes it.
using FaultHook = void (*)(const char* name);
inline std::atomic<FaultHook> fault_hook = nullptr;

inline void PassFaultPoint(const char* name) {
  if (const FaultHook hook = fault_hook.load(std::memory_order_relaxed)) hook(name);
}

}  // namespace tissueform
