// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/status.h"

namespace tissueform {

// The same code and message, and the reason that the server gave (ErrorInfoOf in
// core/base/error_reason.h). Where the details have another code, it counts: proxies may end a call
// in words of their own, but leave the server's details.
absl::Status FromGrpcStatus(const grpc::Status& status);

// How a call has ended. CANCELLED is the client's word alone: of a call that it has not cancelled
// something between here and there has gone, and it is Unavailable. Unimplemented says that the
// server is older than the client.
absl::Status EndOfCall(const grpc::Status& status, bool was_cancelled = false);

// Of an upload that has ended well without its answer: a proxy may reset the stream of a call that
// was answered early, and gRPC then drops the answer, but not the OK that followed. Unavailable.
absl::Status AnswerWasLost();

// Lets a proxy send the call to the server of `session` ("sessions/{id}"); see kSessionHeader.
void AddSessionHeader(const std::string& session, grpc::ClientContext* context);

// The name that the server of a call has said in its initial metadata, which must have come; empty
// where it is of no cluster.
std::string NodeOf(const grpc::ClientContext& context);

}  // namespace tissueform
