// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <dlfcn.h>

#include "absl/synchronization/mutex.h"
#include <sanitizer/tsan_interface.h>

// Debian's Abseil is not instrumented, so ThreadSanitizer does not see that its mutex, which gRPC
// uses, hands objects from thread to thread. Test programs therefore call the library's functions
// through these, which say it. (A reactor may be finished by a worker before gRPC binds it to its
// call: only gRPC's mutex lies between the two.)
namespace {

template <typename Function>
Function Next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

namespace absl {
ABSL_NAMESPACE_BEGIN

void Mutex::Lock() {
  static const auto next = Next<void (*)(Mutex*)>("_ZN4absl7debian35Mutex4LockEv");
  next(this);
  __tsan_acquire(this);
}

void Mutex::Unlock() {
  static const auto next = Next<void (*)(Mutex*)>("_ZN4absl7debian35Mutex6UnlockEv");
  __tsan_release(this);
  next(this);
}

bool Mutex::TryLock() {
  static const auto next = Next<bool (*)(Mutex*)>("_ZN4absl7debian35Mutex7TryLockEv");
  const bool locked = next(this);
  if (locked) __tsan_acquire(this);
  return locked;
}

ABSL_NAMESPACE_END
}  // namespace absl
