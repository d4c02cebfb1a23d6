// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh_io/isolated_read.h"

#include "core/base/status_macros.h"
#include "core/mesh_io/raw_mesh_pipe.h"
#include "core/process/isolated_process.h"

namespace tissueform {
namespace {

constexpr char kWhat[] = "reading it";

absl::StatusOr<RawMesh> ReadWithoutExceptions(
    const IsolationLimits& limits, const std::function<absl::StatusOr<RawMesh>()>& read) {
  absl::StatusOr<RawMesh> mesh = absl::InternalError("not read");
  const absl::Status status = WithoutExceptions(kWhat, limits, [&] {
    mesh = read();
    return mesh.status();
  });
  if (!status.ok()) return status;
  return mesh;
}

}  // namespace

absl::StatusOr<RawMesh> ReadIsolated(const MeshReadLimits& limits,
                                     const std::function<absl::StatusOr<RawMesh>()>& read) {
  const IsolationLimits isolation{limits.max_memory_bytes, limits.max_seconds};
  absl::StatusOr<RawMesh> mesh = absl::InternalError("not received");
  TF_RETURN_IF_ERROR(RunIsolated(
      kWhat, isolation,
      [&](int descriptor) {
        return SendRawMesh(descriptor, ReadWithoutExceptions(isolation, read));
      },
      [&](int descriptor) {
        mesh = ReceiveRawMesh(descriptor, limits.max_memory_bytes);
        return mesh.status();
      }));
  return mesh;
}

}  // namespace tissueform
