// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"

#include "server/session/clock.h"
#include "server/session/session_table.h"
#include "server/store/session_record.h"
#include "server/store/session_store.h"

namespace tissueform {

// How the table of sessions follows a store that others write to as well. News may come late,
// twice, and of what this server has done itself: what it holds or makes it knows better.
//
// Thread-safe.
class StoreSync {
 public:
  // All must outlive it.
  StoreSync(SharedSessionTable* sessions, SessionStore* store, const Clock* clock)
      : sessions_(sessions), store_(store), clock_(clock) {}

  // All that the store has. Blocks. Errors: those of SessionStore::List.
  absl::Status LearnKnown() ABSL_LOCKS_EXCLUDED(sessions_->mutex);

  // A session that there is; nothing where it is known, being made or being deleted.
  void OnCreated(const SessionRecord& record) ABSL_LOCKS_EXCLUDED(sessions_->mutex);
  // The same of one that may be known as it was before.
  void Changed(const SessionRecord& record) ABSL_LOCKS_EXCLUDED(sessions_->mutex);

  // Learns a session from the store. `done` comes from this thread or one of the store's. Errors:
  // those of SessionStore::Get, or of Peek where the caller may ask another server.
  void Ask(const std::string& id, const std::function<void(absl::Status)>& done);
  void AskBriefly(const std::string& id, const std::function<void(absl::Status)>& done);

 private:
  SessionStore::RecordCallback Learning(const std::function<void(absl::Status)>& done);
  SessionEntry KnownFrom(const SessionRecord& record) const;

  SharedSessionTable* const sessions_;
  SessionStore* const store_;
  const Clock* const clock_;
};

}  // namespace tissueform
