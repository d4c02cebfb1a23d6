// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <deque>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/exports/export_queue.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_registry.h"
#include "server/store/postgres_store/change_listener.h"
#include "server/store/postgres_store/postgres_options.h"
#include "server/store/postgres_store/store_change.h"
#include "server/store/stores.h"

namespace tissueform {

// The parts of this server that hold data of the shared store and must follow others' changes.
struct ClusterListeners {
  Stores* stores = nullptr;  // those of the database themselves
  SessionRegistry* sessions = nullptr;
  MeshCatalog* meshes = nullptr;
  ExportQueue* exports = nullptr;
};

// Follows what others change in the store: reads what a notice names and notifies the listeners, on
// a thread of its own. A notice says where to look, and the store's present state counts: so it may
// come late or twice, or be of this server's own change. After a possible gap, all is read again.
class ChangeFollower {
 public:
  // Listens when it returns; no listener is called before Begin. Errors: ChangeListener::Start's.
  static absl::StatusOr<std::unique_ptr<ChangeFollower>> Start(const PostgresOptions& options);
  // No listener is called after it.
  ~ChangeFollower();
  ChangeFollower(const ChangeFollower&) = delete;
  ChangeFollower& operator=(const ChangeFollower&) = delete;

  // `rooms`, which must outlive it, have read the store: they receive what has changed since Start
  // first. Once.
  void Begin(const ClusterListeners& rooms);

 private:
  ChangeFollower() = default;

  void OnRemoteChange(const StoreChange& change);
  // False at the end.
  bool Next(StoreChange* change);
  void Loop();
  absl::Status Apply(const StoreChange& change);
  absl::Status LookAtSession(const std::string& id);
  absl::Status LookAtMesh(const std::string& sha256);
  absl::Status ResyncAll();
  // What was known before and is not there goes.
  absl::Status LookAtAllSessions(const std::vector<std::string>& known);

  ClusterListeners rooms_;  // constant once its thread runs

  Mutex mutex_;
  ConditionVariable changed_;
  std::deque<StoreChange> heard_ ABSL_GUARDED_BY(mutex_);
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;
  std::unique_ptr<ChangeListener> listener_;  // last: it uses the others
};

}  // namespace tissueform
