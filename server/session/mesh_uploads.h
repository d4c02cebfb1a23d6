// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/store/upload_store.h"

namespace tissueform {

// How far an upload has come.
struct UploadProgress {
  int64_t committed_bytes = 0;
  int64_t total_bytes = 0;
};

class MeshUploads;

// One client's upload of a mesh. No other upload writes its part at the same time. One thread at a
// time; all calls, and its end, block on the disk.
class MeshUpload {
 public:
  // What has come is synced, so that it is there for the next attempt; a part without a byte goes.
  ~MeshUpload();
  MeshUpload(const MeshUpload&) = delete;
  MeshUpload& operator=(const MeshUpload&) = delete;

  // Takes one chunk. The first one goes on where the part ends, or starts again at 0; the others
  // follow without gaps. `last`: the mesh is complete.
  //
  // Errors: InvalidArgument (too large, out of place, past the end; the last before all bytes are
  // there), those of UploadStore::Append. After an error nothing of the chunk was taken, save that
  // a last one may be too early.
  absl::Status Write(int64_t offset, absl::string_view data, bool last);

  // Where the next chunk belongs.
  int64_t received_bytes() const { return received_bytes_; }

  // Checks and keeps the mesh: see MeshCatalog::Admit, whose errors it has. The part goes when the
  // mesh is kept or its bytes are no good; otherwise it stays, and the mesh needs not be sent
  // again. REQUIRES: the last chunk was written.
  absl::StatusOr<std::shared_ptr<const StoredMesh>> Finish();

 private:
  friend class MeshUploads;

  MeshUpload(MeshUploads* uploads, UploadAnnouncement announced);

  absl::Status BeginAnew();

  MeshUploads* const uploads_;
  const UploadAnnouncement announced_;
  int64_t received_bytes_ = 0;
  bool first_ = true;  // no chunk has come
};

// Meshes on their way to the catalog: on the disk (UploadStore), without memory of their size until
// they are whole. One upload of a mesh by one owner at a time: a second one is refused, and no
// bytes mix.
//
// Thread-safe.
class MeshUploads {
 public:
  // All must outlive it, and it all its uploads.
  MeshUploads(const ServiceLimits& limits, MeshCatalog* catalog, UploadStore* store)
      : limits_(limits), catalog_(catalog), store_(store) {}

  // Begins an upload, or goes on with the part that is there. One that was announced otherwise is
  // dropped. Blocks on the disk.
  //
  // Errors: those of MeshCatalog::Check and UploadStore::Begin; Aborted: another client is sending
  // this mesh.
  absl::StatusOr<std::unique_ptr<MeshUpload>> Open(UploadAnnouncement announced);

  // How much of what this owner sends is on the disk and will be there after a crash. Blocks on the
  // disk. Errors: NotFound, those of UploadStore::Committed.
  absl::StatusOr<UploadProgress> Query(const std::string& sha256, const std::string& owner = "");

 private:
  friend class MeshUpload;

  absl::Status Claim(const std::string& part_name);
  void Release(const std::string& part_name);

  // Constant.
  const ServiceLimits limits_;
  MeshCatalog* const catalog_;
  UploadStore* const store_;

  Mutex mutex_;
  std::set<std::string> claimed_ ABSL_GUARDED_BY(mutex_);  // parts of open uploads
};

}  // namespace tissueform
