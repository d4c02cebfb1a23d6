// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/mesh/payload/mesh_payload.h"

namespace tissueform {

// What is known of a mesh without reading it.
struct MeshRecord {
  std::string sha256;  // MeshPayloadView::Sha256
  MeshPayloadShape shape;
  int64_t total_bytes = 0;        // of the payload
  int64_t created_s = 0;          // unix seconds
  int64_t last_used_s = 0;        // never goes back
  int64_t skin_vertex_count = 0;  // what the server found when it checked the mesh
};

// Where meshes are kept. They never change: the same name is the same mesh.
//
// Calls block, for as long as the disk takes: make them on workers, never where a frame waits. What
// a call has answered is durable as far as the store is. tests/server/store holds the contract.
//
// Thread-safe.
class MeshStore {
 public:
  struct Page {
    std::vector<MeshRecord> records;  // by sha256, rising
    std::string next;                 // give it as `after`; empty: that was all
  };

  virtual ~MeshStore() = default;

  // Keeps a mesh. Where it is kept already only last_used_s may rise. REQUIRES: record.sha256 is
  // the payload's (the code that checked the upload has computed it).
  //
  // Errors: InvalidArgument (no SHA-256; shape or size is not the payload's), ResourceExhausted
  // (the disk is full), or what the disk says.
  virtual absl::Status Put(const MeshRecord& record, const MeshPayloadView& payload) = 0;

  // Errors: NotFound.
  virtual absl::StatusOr<MeshRecord> Find(const std::string& sha256) = 0;

  // The mesh, with its digest checked.
  //
  // Errors: NotFound; DataLoss: what was kept is not that mesh. It is set aside then, and the next
  // call says NotFound: the client may upload it again.
  virtual absl::StatusOr<MeshPayload> Read(const std::string& sha256) = 0;

  // Names greater than `after`. Errors: InvalidArgument (limit < 1).
  virtual absl::StatusOr<Page> List(const std::string& after, int limit) = 0;

  // Errors: NotFound; FailedPrecondition (MESH_IN_USE) where the store knows that sessions are made
  // from it.
  virtual absl::Status Delete(const std::string& sha256) = 0;

  // As SessionStore::Touch and ListUnused.
  virtual absl::Status Touch(const std::vector<std::string>& sha256s, int64_t now_s) = 0;
  virtual absl::StatusOr<std::vector<MeshRecord>> ListUnused(int64_t before_s, int limit) = 0;
};

// InvalidArgument when the record is not of this payload. Looks at shape and size only.
absl::Status CheckMeshRecord(const MeshRecord& record, const MeshPayloadView& payload);

}  // namespace tissueform
