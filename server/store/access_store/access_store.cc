// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/access_store/access_store.h"

#include <cstdlib>

#include "server/store/access_store/durable_access_store.h"
#include "server/store/access_store/in_memory_access_store.h"

namespace tissueform {

std::unique_ptr<AccessStore> OpenAccessStore(Stores* stores) {
  if (!stores->keeps()) return std::make_unique<InMemoryAccessStore>();
  // In memory they would be lost in silence: such a store has rows of its own.
  if (stores->commit_thread() == nullptr) std::abort();
  return std::make_unique<DurableAccessStore>(stores->commit_thread());
}

}  // namespace tissueform
