// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/client_call.h"

#include "absl/status/statusor.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

#include "core/base/error_reason.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {

absl::Status FromGrpcStatus(const grpc::Status& status) {
  const absl::Status plain(static_cast<absl::StatusCode>(status.error_code()),
                           status.error_message());
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return plain;
  for (const google::protobuf::Any& detail : details.details()) {
    google::rpc::ErrorInfo info;
    if (detail.UnpackTo(&info)) {
      return WithErrorInfo(
          plain, {info.reason(), ErrorMetadata(info.metadata().begin(), info.metadata().end())});
    }
  }
  return plain;
}

void AddSessionHeader(const std::string& session, grpc::ClientContext* context) {
  // Not of a name that is none: the server refuses it, and a header takes only some letters.
  if (const absl::StatusOr<std::string> id = ParseSessionName(session); id.ok()) {
    context->AddMetadata(kSessionHeader, *id);
  }
}

std::string NodeOf(const grpc::ClientContext& context) {
  const auto& metadata = context.GetServerInitialMetadata();
  const auto node = metadata.find(kNodeHeader);
  return node == metadata.end() ? "" : std::string(node->second.data(), node->second.size());
}

}  // namespace tissueform
