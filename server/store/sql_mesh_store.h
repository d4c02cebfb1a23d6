// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/mesh_store.h"
#include "server/store/sql_blobs.h"
#include "server/store/sql_database.h"

namespace tissueform {

// Rows that claim blobs. The blob of a mesh begins with the text of its shape, so that its SHA-256
// is the mesh's name.
class SqlMeshStore : public MeshStore {
 public:
  // Both must outlive it.
  SqlMeshStore(SqlDatabase* database, SqlBlobs* blobs) : database_(database), blobs_(blobs) {}

  absl::Status Put(const MeshRecord& record, const MeshPayloadView& payload) override;
  absl::StatusOr<MeshRecord> Find(const std::string& sha256) override;
  absl::StatusOr<MeshPayload> Read(const std::string& sha256) override;
  absl::StatusOr<Page> List(const std::string& after, int limit) override;
  absl::Status Delete(const std::string& sha256) override;
  absl::Status Touch(const std::vector<std::string>& sha256s, int64_t now_s) override;
  absl::StatusOr<std::vector<MeshRecord>> ListUnused(int64_t before_s, int limit) override;

 private:
  SqlDatabase* const database_;
  SqlBlobs* const blobs_;
};

BlobClaim ClaimOf(const MeshRecord& record);

}  // namespace tissueform
