// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/blob_store.h"
#include "server/store/commit_thread.h"
#include "server/store/mesh_store.h"
#include "server/store/prediction_store.h"
#include "server/store/store_records.h"

namespace tissueform {

// Meshes and predictions: rows of a database that claim blobs (claimed_blobs.h).

// The blob of a mesh begins with the text of its shape, so that its SHA-256 is the mesh's name.
class DurableMeshStore final : public MeshStore {
 public:
  // Both must outlive it.
  DurableMeshStore(CommitThread* thread, BlobStore* blobs) : thread_(thread), blobs_(blobs) {}

  absl::Status Put(const MeshRecord& record, const MeshPayloadView& payload) override;
  absl::StatusOr<MeshRecord> Find(const std::string& sha256) override;
  absl::StatusOr<MeshPayload> Read(const std::string& sha256) override;
  absl::StatusOr<Page> List(const std::string& after, int limit) override;
  absl::Status Delete(const std::string& sha256) override;
  absl::Status Touch(const std::vector<std::string>& sha256s, int64_t now_s) override;
  absl::StatusOr<std::vector<MeshRecord>> ListUnused(int64_t before_s, int limit) override;

 private:
  absl::StatusOr<MeshPayload> ReadBlob(const MeshRecord& record);

  CommitThread* const thread_;
  BlobStore* const blobs_;
};

class DurablePredictionStore final : public PredictionStore {
 public:
  // Both must outlive it.
  DurablePredictionStore(CommitThread* thread, BlobStore* blobs) : thread_(thread), blobs_(blobs) {}

  absl::Status Create(const PredictionRecord& record, const std::string& positions) override;
  absl::StatusOr<PredictionRecord> Get(const std::string& id) override;
  absl::StatusOr<std::string> Positions(const std::string& id) override;
  absl::StatusOr<Page> List(const ListRequest& request) override;
  absl::Status Delete(const std::string& id) override;

 private:
  absl::StatusOr<PredictionRow> Find(const std::string& id);

  CommitThread* const thread_;
  BlobStore* const blobs_;
};

// Whether a blob has the size that its mesh needs; OK when it has. NotFound, DataLoss.
absl::Status CheckMeshBlobSize(const BlobStore& blobs, const MeshRecord& record);
absl::Status CheckPositionsSize(const BlobStore& blobs, const PredictionRow& row);

}  // namespace tissueform
