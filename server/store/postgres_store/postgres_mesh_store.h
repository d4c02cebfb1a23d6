// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/store/mesh_store.h"
#include "server/store/postgres_store/postgres_pool.h"

namespace tissueform {

// Meshes in a PostgreSQL database. `pool` must outlive it.
class PostgresMeshStore final : public MeshStore {
 public:
  explicit PostgresMeshStore(PostgresPool* pool) : pool_(pool) {}

  absl::Status Put(const MeshRecord& record, const MeshPayloadView& payload) override;
  absl::StatusOr<MeshRecord> Find(const std::string& sha256) override;
  absl::StatusOr<MeshPayload> Read(const std::string& sha256) override;
  absl::StatusOr<Page> List(const std::string& after, int limit) override;
  absl::Status Delete(const std::string& sha256) override;
  absl::Status Touch(const std::vector<std::string>& sha256s, int64_t now_s) override;
  absl::StatusOr<std::vector<MeshRecord>> ListUnused(int64_t before_s, int limit) override;

 private:
  PostgresPool* const pool_;
};

}  // namespace tissueform
