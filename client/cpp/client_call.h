// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/status.h"

namespace tissueform {

// The same code and message, and the reason that the server gave (ErrorInfoOf in
// core/base/error_reason.h).
absl::Status FromGrpcStatus(const grpc::Status& status);

// Lets a proxy send the call to the server of `session` ("sessions/{id}"); see kSessionHeader.
void AddSessionHeader(const std::string& session, grpc::ClientContext* context);

// The name that the server of a call has said in its initial metadata, which must have come; empty
// where it is of no cluster.
std::string NodeOf(const grpc::ClientContext& context);

}  // namespace tissueform
