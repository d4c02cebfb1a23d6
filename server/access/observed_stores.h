// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "server/access/access_changes.h"
#include "server/store/stores.h"

namespace tissueform {

// `stores`, of whose sessions, predictions and cases `changes` is told: those that are made and
// those that go, before whoever made or removed them hears of it; and all sessions that a list of
// all owners gives. `changes` must outlive it.
std::unique_ptr<Stores> WatchStores(std::unique_ptr<Stores> stores, AccessChanges* changes);

// Tells `changes` of the predictions and cases that are kept. (Sessions are told by who learns what
// is known, StoreSync::LearnAll.) Blocks. Errors: those of the stores.
absl::Status NotifyExisting(Stores* stores, AccessChanges* changes);

}  // namespace tissueform
