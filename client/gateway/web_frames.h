// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/gateway/http_message.h"
#include "client/gateway/upstream_call.h"

// Binary gRPC-Web as bytes (https://github.com/grpc/grpc/blob/master/doc/PROTOCOL-WEB.md).
namespace tissueform {

constexpr absl::string_view kWebContentType = "application/grpc-web+proto";

// Whether a request is binary gRPC-Web by its content-type.
bool IsWebContentType(absl::string_view content_type);

// The message of a request's body: one frame, uncompressed, and nothing after it. A view of `body`.
//
// Errors: InvalidArgument when it is not that; Unimplemented when it is compressed.
absl::StatusOr<absl::string_view> ParseWebRequest(absl::string_view body);

// The frame of one message of a reply.
std::string WebMessageFrame(absl::string_view message);

// How a call ended: as header fields of a reply that has nothing else ("trailers-only"), and as the
// last frame of one that has.
HttpFields WebEndFields(const CallEnd& end);
std::string WebEndFrame(const CallEnd& end);

}  // namespace tissueform
