// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/backoff.h"
#include "core/mesh/payload/mesh_payload.h"
#include "tissueform/v1/mesh_service.grpc.pb.h"

namespace tissueform {

// How an upload goes. All functions may be empty, and are called on the thread that uploads.
struct UploadOptions {
  // After each chunk: how much of the mesh was given to the connection or was there before.
  std::function<void(int64_t sent_bytes, int64_t total_bytes)> on_progress;
  // The connection or the server is away; it tries again.
  std::function<void(const absl::Status& why)> on_interrupted;
  // It goes on where the server has it from an earlier attempt, of this call or another one.
  std::function<void(int64_t from_bytes, int64_t total_bytes)> on_resumed;

  Backoff::Options backoff;
  // When no attempt has come farther than those before for so long, it ends with the last error.
  std::chrono::milliseconds give_up_after{60'000};
};

// Sends a mesh, from where an earlier attempt broke off, until the server has it. Tries again when
// the connection breaks, when the server ends or is started again, and as long as another client
// sends the same mesh; not when the server has no room (RESOURCE_EXHAUSTED): what has come stays
// there, and the next call goes on.
//
// Each attempt has `call_deadline`. `payload` is named `sha256`. Errors: those of the rpc.
absl::StatusOr<v1::Mesh> SendMesh(v1::MeshService::Stub* meshes, const MeshPayloadView& payload,
                                  const std::string& sha256,
                                  std::chrono::milliseconds call_deadline,
                                  const UploadOptions& options);

}  // namespace tissueform
