// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "server/access/access_changes.h"
#include "tests/testing/in_memory_stores.h"

namespace tissueform::testing {

// Access on a server without logins: every caller may do everything.
struct NoLogins {
  InMemoryAccessStore store;
  AccessQueries queries{store.database()};
  Access access{&queries};
  AccessChanges changes{{}, &store, &access};
};

}  // namespace tissueform::testing
