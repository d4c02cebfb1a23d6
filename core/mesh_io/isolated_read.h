// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include "absl/status/statusor.h"

#include "core/mesh_io/mesh_read_limits.h"
#include "core/mesh_io/raw_mesh.h"

namespace tissueform {

// Runs `read` in a child process of its own and hands its result over: file libraries crash, loop,
// print and end the program on damaged files, and Gmsh knows one state for the whole process. The
// child is bound to the limits (memory beyond what this process has now, processor time), cannot
// write files, and what it prints is lost. Internal to core/mesh_io.
//
// Errors: those of `read`; InvalidArgument when the child ended without a result; ResourceExhausted
// when a limit stopped it; Internal when there can be no child.
//
// REQUIRES: `read` needs no other thread of this process and no lock that one may hold.
absl::StatusOr<RawMesh> ReadIsolated(const MeshReadLimits& limits,
                                     const std::function<absl::StatusOr<RawMesh>()>& read);

}  // namespace tissueform
