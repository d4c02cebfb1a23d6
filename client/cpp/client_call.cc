// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/client_call.h"

#include "absl/status/statusor.h"

#include "proto/conversion/session_conversion.h"

namespace tissueform {

absl::Status FromGrpcStatus(const grpc::Status& status) {
  return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
}

void AddSessionHeader(const std::string& session, grpc::ClientContext* context) {
  // Not of a name that is none: the server refuses it, and a header takes only some letters.
  if (const absl::StatusOr<std::string> id = ParseSessionName(session); id.ok()) {
    context->AddMetadata(kSessionHeader, *id);
  }
}

}  // namespace tissueform
