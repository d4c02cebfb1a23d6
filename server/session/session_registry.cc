// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_registry.h"

namespace tissueform {

void SessionRegistry::Lost(const std::string& id) {
  table_.Lost(id);
  if (!leases_->Holds(id)) loader_.Lost(id);
}

void SessionRegistry::HandOver(std::chrono::steady_clock::time_point deadline) {
  leases_->StopTaking();
  for (const std::string& id : leases_->Held()) {
    leases_->GiveUp(id);
    Lost(id);
    sync_.WaitForCommits(id, deadline);
    // A commit that is still under way is refused once another server has the session.
    if (std::chrono::steady_clock::now() < deadline) leases_->Release(id);
  }
}

}  // namespace tissueform
