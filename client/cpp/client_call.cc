// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/client_call.h"

#include "absl/status/statusor.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

#include "core/base/error_reason.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {

namespace {

constexpr int kLastCode = static_cast<int>(grpc::StatusCode::UNAUTHENTICATED);

bool HasAnotherCode(const google::rpc::Status& details, const grpc::Status& status) {
  return details.code() > 0 && details.code() <= kLastCode && details.code() != status.error_code();
}

}  // namespace

absl::Status FromGrpcStatus(const grpc::Status& status) {
  absl::Status plain(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
  google::rpc::Status details;
  if (status.ok() || !details.ParseFromString(status.error_details())) return plain;
  if (HasAnotherCode(details, status)) {
    plain = absl::Status(static_cast<absl::StatusCode>(details.code()), details.message());
  }
  for (const google::protobuf::Any& detail : details.details()) {
    google::rpc::ErrorInfo info;
    if (detail.UnpackTo(&info)) {
      return WithErrorInfo(
          plain, {info.reason(), ErrorMetadata(info.metadata().begin(), info.metadata().end())});
    }
  }
  return plain;
}

absl::Status EndOfCall(const grpc::Status& status, bool was_cancelled) {
  const absl::Status end = FromGrpcStatus(status);
  if (absl::IsUnimplemented(end)) {
    return absl::UnimplementedError(
        "this server is older than this program and does not have this call; update the server, or "
        "use the program of its version");
  }
  if (was_cancelled || !absl::IsCancelled(end)) return end;
  const ErrorInfo info = ErrorInfoOf(end);
  const absl::Status lost = absl::UnavailableError(end.message());
  return info.reason == ReasonName(ErrorReason::kCancelled) ? lost : WithErrorInfo(lost, info);
}

absl::Status AnswerWasLost() {
  return absl::UnavailableError("the server's answer was lost in transit");
}

void AddSessionHeader(const std::string& session, grpc::ClientContext* context) {
  // Not for an invalid name: the server refuses it, and a header takes only some letters.
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
