// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"
#include "core/mesh/payload/mesh_payload.h"

namespace tissueform {

// What a client says of a mesh before it sends it.
struct UploadAnnouncement {
  MeshPayloadShape shape;
  int64_t total_bytes = 0;
  std::string sha256;
  std::string owner = {};  // who sends it
};

// The name of its part: the mesh's SHA-256, or of an owner with a name a digest of both. So a user
// can neither continue nor detect another user's upload.
std::string PartName(const UploadAnnouncement& announcement);

struct UploadLimits {
  int64_t max_bytes = int64_t{8} << 30;  // received of all parts together
  int max_parts = 256;
  // Where a new part finds no place, parts that have received nothing for so long go, the oldest
  // first: otherwise a client that breaks off 256 uploads keeps all others out for a day.
  std::chrono::seconds spared{600};
  // Bytes that have come since a part was synced and so long ago are synced with the next ones, so
  // that of an upload over a slow line little is lost with the server.
  std::chrono::milliseconds sync_every{2'000};
};

// Meshes that have not arrived in full: one file each (PartName.part) and one with the announcement
// (PartName.announced), so that an upload goes on after a restart, and no memory is
// needed before it is whole.
//
// What is said to be committed (Begin, Committed) is on the disk: these sync first. Between them a
// part is synced every kSyncEveryBytes and UploadLimits::sync_every. After a restart a part ends
// where it was last synced, so call Committed however a stream ends.
//
// Calls block on the disk. Thread-safe; calls for one part take turns.
class UploadStore {
 public:
  static constexpr int64_t kSyncEveryBytes = int64_t{16} << 20;

  // Takes up the parts in the folder; creates the folder if it does not exist. A part that cannot
  // be taken up (cut, damaged, announced differently) is removed: its client starts again. Errors:
  // what the disk says.
  static absl::StatusOr<std::unique_ptr<UploadStore>> Open(std::string folder,
                                                           UploadLimits limits = {});
  // In a new private folder below the system's temporary one, which goes with this object. Nothing
  // is synced.
  static absl::StatusOr<std::unique_ptr<UploadStore>> OpenTemporary(UploadLimits limits = {});

  ~UploadStore();
  UploadStore(const UploadStore&) = delete;
  UploadStore& operator=(const UploadStore&) = delete;

  // Begins an upload, or goes on with one that was announced in the same way: returns how many
  // bytes are committed. One of the same name that was announced otherwise is dropped.
  //
  // Errors: InvalidArgument (no SHA-256; the size is not the shape's), ResourceExhausted (too many
  // parts; the disk is full), or what the disk says.
  absl::StatusOr<int64_t> Begin(const UploadAnnouncement& announcement);

  // Adds bytes. Errors: NotFound; InvalidArgument (`offset` is not where the part ends, the message
  // says where that is; past the announced end); ResourceExhausted (over the limit of all parts;
  // the disk is full). After an error the part is as it was.
  absl::Status Append(const std::string& part_name, int64_t offset, absl::string_view bytes);

  // How many bytes are there, after they were synced. Errors: NotFound, or what the disk says;
  // DataLoss from then on, until it is started again.
  absl::StatusOr<int64_t> Committed(const std::string& part_name);

  // What was announced. Errors: NotFound.
  absl::StatusOr<UploadAnnouncement> Announced(const std::string& part_name);

  // The whole payload, in memory of its size; the part stays. The digest is not checked.
  // Errors: NotFound, FailedPrecondition (it is not whole), or what the disk says.
  absl::StatusOr<MeshPayload> Read(const std::string& part_name);
  // Read, then Drop.
  absl::StatusOr<MeshPayload> Take(const std::string& part_name);

  // Forgets a part. Errors: NotFound, or what the disk says.
  absl::Status Drop(const std::string& part_name);

  // Forgets the parts that have not changed since then (unix seconds); returns how many.
  absl::StatusOr<int> RemoveOlderThan(int64_t before_s);

 private:
  struct Part;

  UploadStore(std::string folder, UploadLimits limits, bool durable);

  absl::Status TakeUp();
  absl::Status TakeUpPart(const std::string& base);
  absl::StatusOr<std::shared_ptr<Part>> Find(const std::string& part_name);
  absl::StatusOr<std::shared_ptr<Part>> Make(const UploadAnnouncement& announcement);
  absl::Status Remove(const std::shared_ptr<Part>& part);
  // Those that have not changed since then (unix seconds), the oldest first. Looks at the disk.
  std::vector<std::shared_ptr<Part>> OlderThan(int64_t before_s);
  absl::Status MakeRoom(int64_t bytes) ABSL_EXCLUSIVE_LOCKS_REQUIRED(begin_mutex_);
  // Whether there is a place for one more part that is to grow so large.
  bool HasRoom(int64_t bytes);
  absl::Status ReserveBytes(int64_t bytes);

  const std::string folder_;
  const UploadLimits limits_;
  const bool durable_;

  Mutex begin_mutex_;  // before a part's and before the next
  Mutex mutex_;        // innermost; never waits for the disk
  std::map<std::string, std::shared_ptr<Part>> parts_ ABSL_GUARDED_BY(mutex_);
  int64_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;  // of all parts
};

}  // namespace tissueform
