// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

// Of a prediction's positions: x, y and z as float32.
inline constexpr int64_t kVertexBytes = 3 * int64_t{sizeof(float)};

// What is kept of a prediction beside its positions.
struct PredictionRecord {
  std::string id;  // one in a store
  std::string owner;
  std::string session;           // id of the session that made it; it may be gone
  std::string mesh_sha256;       // the mesh may be gone, too
  std::string case_sha256 = {};  // that it was planned in, or empty; it need not be here
  int64_t created_s = 0;         // unix seconds
  std::string metadata;          // the server's bytes: poses, model, version, quality
  int64_t vertex_count = 0;
};

// Where predictions are kept. They never change.
//
// Calls block; durable when answered; thread-safe: as MeshStore.
class PredictionStore {
 public:
  struct ListRequest {
    std::optional<std::string> owner = {};        // of this one only; unset: of all
    std::set<std::string> also = {};              // ids of others, where an owner is set
    std::optional<std::string> session = {};      // of this one only; unset: of all
    std::optional<std::string> case_sha256 = {};  // of this one only; unset: of all
    std::string after = {};                       // ids greater than this
    int limit = 100;                              // at least 1
  };
  struct Page {
    std::vector<PredictionRecord> records;  // by id, rising
    std::string next;                       // give it as `after`; empty: that was all
  };

  virtual ~PredictionStore() = default;

  // Keeps a prediction; `positions` are x, y and z of every vertex, float32 little-endian.
  //
  // Errors: InvalidArgument (no id, positions are not 12 bytes a vertex), AlreadyExists,
  // ResourceExhausted (the disk is full), or what the disk says.
  virtual absl::Status Create(const PredictionRecord& record, const std::string& positions) = 0;

  // Errors: NotFound.
  virtual absl::StatusOr<PredictionRecord> Get(const std::string& id) = 0;

  // Errors: NotFound; DataLoss: they are not what was kept. They are set aside then.
  virtual absl::StatusOr<std::string> Positions(const std::string& id) = 0;

  // Errors: InvalidArgument (limit).
  virtual absl::StatusOr<Page> List(const ListRequest& request) = 0;

  // Errors: NotFound.
  virtual absl::Status Delete(const std::string& id) = 0;
};

// What Create refuses without looking further.
absl::Status CheckPrediction(const PredictionRecord& record, const std::string& positions);

}  // namespace tissueform
