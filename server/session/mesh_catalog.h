// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"
#include "core/mesh/payload/mesh_payload.h"
#include "core/mesh/tet_mesh.h"
#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/memory_budget.h"
#include "server/store/mesh_store.h"
#include "server/store/session_store.h"
#include "server/store/upload_store.h"

namespace tissueform {

// A mesh as the server keeps it: complete, finite and usable. Immutable.
struct StoredMesh {
  MemoryReservation reservation;  // given back after everything below is gone
  std::string sha256;
  TetMesh mesh;
  std::vector<CellArray> cell_arrays;
  TriangleIndices skin_facets;  // BoundaryFacets
  std::vector<int32_t> skin;    // their vertices, rising

  // Null when the mesh has no array of that name.
  const CellArray* FindCellArray(absl::string_view name) const;
};

// A mesh as it is kept, and itself while it is in memory.
struct MeshView {
  MeshRecord record;
  std::shared_ptr<const StoredMesh> mesh;  // null: in the store only
};
MeshRecord RecordOf(const StoredMesh& mesh);

struct MeshViewPage {
  std::vector<MeshView> views;
  std::string next;  // MeshStore::Page::next
};

// The meshes of the server by their SHA-256: those in use are in memory, and where there is a store
// all are in it.
//
// Thread-safe.
class MeshCatalog {
 public:
  // `budget` must outlive the catalog and all its meshes, `store` (null: nothing is kept) and
  // `clock` the catalog.
  MeshCatalog(const ServiceLimits& limits, MemoryBudget* budget, MeshStore* store = nullptr,
              const Clock* clock = Clock::System(), UnixClock unix_clock = SystemUnixSeconds);

  // Called for every mesh that was removed, from any thread, without a lock held. It may not
  // block. Call it before anything else.
  void set_on_removed(std::function<void(const std::string& sha256)> on_removed) {
    on_removed_ = std::move(on_removed);
  }

  // Where meshes take their memory from, and what is made of them should, too.
  MemoryBudget* budget() const { return budget_; }

  // What is not in memory can be had again.
  bool keeps_meshes() const { return store_ != nullptr; }

  // What can be said of a mesh before a byte of it has come: CheckAnnouncedMesh within the limits.
  absl::Status Check(const UploadAnnouncement& announced) const;

  // Reserves memory, then reads the payload that has come, checks digest and content, and keeps the
  // mesh. Computes for a while: call it on a worker. Where the same mesh has arrived in the
  // meantime, that one is returned. REQUIRES: Check(announced) is OK.
  //
  // Errors: ResourceExhausted (no room: nothing was read), those of `read`, DataLoss (wrong
  // digest), InvalidArgument (NaN, infinity, not usable), those of MeshStore::Put.
  using ReadPayload = std::function<absl::StatusOr<MeshPayload>()>;
  absl::StatusOr<std::shared_ptr<const StoredMesh>> Admit(const UploadAnnouncement& announced,
                                                          const ReadPayload& read);

  // In memory. Null when it is not.
  std::shared_ptr<const StoredMesh> Find(const std::string& sha256);

  // From memory or the store. Blocks on the disk.
  //
  // Errors: NotFound; ResourceExhausted (no room); those of MeshStore::Read.
  absl::StatusOr<std::shared_ptr<const StoredMesh>> Load(const std::string& sha256);

  // Without reading it. Blocks on the disk. Errors: NotFound, those of MeshStore::Find and List.
  absl::StatusOr<MeshView> Look(const std::string& sha256);
  absl::StatusOr<MeshViewPage> List(const std::string& after, int limit);

  // Users in memory keep the mesh until they end; one that is on its way here arrives first, or
  // comes after it. Blocks on the disk. Errors: NotFound, those of MeshStore::Delete.
  absl::Status Remove(const std::string& sha256);

  // Another server has deleted it: out of memory, and nothing else. Who uses it keeps it.
  void Forget(const std::string& sha256);
  // The names of those in memory.
  std::vector<std::string> HeldNames() const;

  // Takes the meshes out of memory that are not in use and that no caller has asked for within
  // `idle`. Returns how many.
  int RemoveIdle(Clock::Duration idle);

  // In memory, and the bytes that they have reserved.
  struct Held {
    int64_t meshes = 0;
    int64_t bytes = 0;
  };
  Held CountHeld() const;

  // Those in memory that are in use, or that a caller has asked for after `since`.
  std::vector<std::string> UsedSince(Clock::TimePoint since);
  // Takes a mesh out of memory and store unless it is one of these, or is on its way here. The
  // caller knows that no session is made from it. Blocks on the disk. False when it stays.
  //
  // Errors: those of MeshStore::Delete. REQUIRES: keeps_meshes().
  absl::StatusOr<bool> RemoveUnused(const std::string& sha256, Clock::TimePoint since);

 private:
  struct Entry {
    std::shared_ptr<const StoredMesh> mesh;
    Clock::TimePoint last_used;
  };

  // While it lives no mesh of that name is removed; the beginning waits for a removal under way.
  class Arrival;

  std::shared_ptr<const StoredMesh> Add(std::shared_ptr<const StoredMesh> mesh);
  // From store and memory. REQUIRES: in removing_, from which it takes it.
  absl::Status FinishRemoval(const std::string& sha256);

  // Constant.
  const ServiceLimits limits_;
  MemoryBudget* const budget_;
  MeshStore* const store_;
  const Clock* const clock_;
  const UnixClock unix_clock_;
  std::function<void(const std::string&)> on_removed_ = [](const std::string& /*sha256*/) {};

  mutable Mutex mutex_;
  std::map<std::string, Entry, std::less<>> meshes_ ABSL_GUARDED_BY(mutex_);
  std::multiset<std::string> arriving_ ABSL_GUARDED_BY(mutex_);
  std::set<std::string> removing_ ABSL_GUARDED_BY(mutex_);
  ConditionVariable moved_;  // something has arrived, or was removed
};

}  // namespace tissueform
