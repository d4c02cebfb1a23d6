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

#include "core/base/mutex.h"
#include "server/store/mesh_store.h"
#include "server/store/prediction_store.h"
#include "server/store/stores.h"

namespace tissueform {

// Meshes and predictions of a server that keeps nothing: they go with the process. Every mesh is
// held here once more, beside the copy that sessions use.
class InMemoryMeshStore : public MeshStore {
 public:
  absl::Status Put(const MeshRecord& record, const MeshPayloadView& payload) override;
  absl::StatusOr<MeshRecord> Find(const std::string& sha256) override;
  absl::StatusOr<MeshPayload> Read(const std::string& sha256) override;
  absl::StatusOr<Page> List(const std::string& after, int limit) override;
  absl::Status Delete(const std::string& sha256) override;
  absl::Status Touch(const std::vector<std::string>& sha256s, int64_t now_s) override;
  absl::StatusOr<std::vector<MeshRecord>> ListUnused(int64_t before_s, int limit) override;

 private:
  struct Mesh {
    MeshRecord record;
    std::shared_ptr<const std::string> bytes;
  };

  Mutex mutex_;
  std::map<std::string, Mesh> meshes_ ABSL_GUARDED_BY(mutex_);
};

class InMemoryPredictionStore final : public PredictionStore {
 public:
  // Where the disk bounds a store on a disk, this bounds one that takes memory from sessions.
  static constexpr int64_t kMaxBytes = int64_t{1} << 30;

  // Refuses (ResourceExhausted) what would make it hold more than `most_bytes` of positions and
  // metadata.
  explicit InMemoryPredictionStore(int64_t most_bytes = kMaxBytes) : most_bytes_(most_bytes) {}

  absl::Status Create(const PredictionRecord& record, const std::string& positions) override;
  absl::StatusOr<PredictionRecord> Get(const std::string& id) override;
  absl::StatusOr<std::string> Positions(const std::string& id) override;
  absl::StatusOr<Page> List(const ListRequest& request) override;
  absl::Status Delete(const std::string& id) override;

 private:
  struct Prediction {
    PredictionRecord record;
    std::string positions;

    int64_t Bytes() const {
      return static_cast<int64_t>(record.metadata.size() + positions.size());
    }
  };

  const int64_t most_bytes_;
  Mutex mutex_;
  int64_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::string, Prediction> predictions_ ABSL_GUARDED_BY(mutex_);
};

// All five. Partial uploads lie in a temporary folder of their own meanwhile.
// Errors: those of UploadStore::OpenTemporary.
absl::StatusOr<std::unique_ptr<Stores>> OpenInMemoryStores(UnixClock clock = SystemUnixSeconds,
                                                           UploadLimits limits = {});

}  // namespace tissueform
