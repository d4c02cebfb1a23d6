// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// Keeps gRPC and protobuf from writing to stderr what a command reports in its own error line.
// Users who look for a fault in gRPC set GRPC_VERBOSITY and see all of it. Call it before any rpc.
void SilenceLibraryLogs();

}  // namespace tissueform
