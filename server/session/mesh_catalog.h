// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh_payload/mesh_payload.h"
#include "server/session/clock.h"
#include "server/session/limits.h"
#include "server/session/memory_budget.h"

namespace tissueform {

// A mesh as the server keeps it: complete, finite and usable. Immutable.
struct StoredMesh {
  MemoryReservation reservation;  // given back after everything below is gone
  std::string sha256;
  TetMesh mesh;
  std::vector<CellArray> cell_arrays;
  std::vector<int32_t> skin;  // BoundaryVertices

  // Null when the mesh has no array of that name.
  const CellArray* FindCellArray(absl::string_view name) const;
};

// What a client says of a mesh before it sends it.
struct MeshAnnouncement {
  MeshPayloadShape shape;
  int64_t total_bytes = 0;
  std::string sha256;
};

// A mesh that is being received; its memory is reserved. One thread at a time.
class MeshUpload {
 public:
  // Takes one chunk. Errors (InvalidArgument): a chunk that is too large, out of place or past the
  // end; `finish` before all bytes are there.
  absl::Status Write(int64_t offset, absl::string_view data, bool finish);

  bool finished() const { return finished_; }
  int64_t committed_bytes() const { return committed_bytes_; }

 private:
  friend class MeshCatalog;

  MeshUpload(MeshAnnouncement announcement, int64_t max_chunk_bytes, MemoryReservation reservation);

  const MeshAnnouncement announcement_;
  const int64_t max_chunk_bytes_;
  MemoryReservation reservation_;
  MeshPayload payload_;
  int64_t committed_bytes_ = 0;
  bool finished_ = false;
};

// The meshes of the server by their SHA-256.
//
// Thread-safe.
class MeshCatalog {
 public:
  // `budget` must outlive the catalog and all its meshes, `clock` the catalog.
  MeshCatalog(const ServiceLimits& limits, MemoryBudget* budget,
              const Clock* clock = Clock::System());

  // Checks what is announced and reserves memory for it.
  //
  // Errors: InvalidArgument (counts, names or digest that cannot be, counts that disagree with the
  // bytes), ResourceExhausted (over a limit, or no room).
  absl::StatusOr<std::unique_ptr<MeshUpload>> StartUpload(MeshAnnouncement announcement);

  // Checks digest and content, and keeps the mesh. Computes for a while: call it on a worker. Where
  // the same mesh has arrived in the meantime, that one is returned.
  //
  // Errors: DataLoss (wrong digest), InvalidArgument (NaN, infinity, not usable). REQUIRES:
  // upload->finished().
  absl::StatusOr<std::shared_ptr<const StoredMesh>> Finish(std::unique_ptr<MeshUpload> upload);

  // Null when the server does not have it.
  std::shared_ptr<const StoredMesh> Find(const std::string& sha256);

  // Users keep the mesh until they end. False when there was none.
  bool Remove(const std::string& sha256);

  // Forgets the meshes that nobody uses and nobody has asked for within the idle TTL. Returns how
  // many.
  int RemoveIdle();

 private:
  struct Entry {
    std::shared_ptr<const StoredMesh> mesh;
    Clock::TimePoint last_used;
  };

  // Constant.
  const ServiceLimits limits_;
  MemoryBudget* const budget_;
  const Clock* const clock_;

  Mutex mutex_;
  std::map<std::string, Entry, std::less<>> meshes_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
