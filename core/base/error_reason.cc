// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/error_reason.h"

#include <array>
#include <utility>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace tissueform {
namespace {

constexpr absl::string_view kPayloadUrl = "type.tissueform/ErrorInfo";

constexpr std::array kNames = {"MESH_NOT_FOUND",
                               "SESSION_NOT_FOUND",
                               "SESSION_ID_TAKEN",
                               "REQUEST_ID_REUSED",
                               "SESSION_BEING_DELETED",
                               "WATCH_NOT_FOUND",
                               "TOO_MANY_SESSIONS",
                               "TOO_MANY_STREAMS",
                               "TOO_MANY_WATCHES",
                               "MEMORY_BUDGET_FULL",
                               "MESH_TOO_LARGE",
                               "SERVER_DRAINING",
                               "MESH_DAMAGED_ON_ITS_WAY",
                               "CHUNK_OUT_OF_PLACE",
                               "UPLOAD_SILENT",
                               "NO_CONFIGURATION_IN_TIME",
                               "POSE_SEQUENCE_NOT_RISING",
                               "NO_PREPARED_ANSWERS",
                               "NOT_POSITIVE_DEFINITE",
                               "STALE_ETAG",
                               "SESSION_UPDATED",
                               "MESH_IN_USE",
                               "PREDICTION_NOT_FOUND",
                               "NOT_COMPARABLE",
                               "UPLOAD_NOT_FOUND",
                               "UPLOAD_UNDER_WAY",
                               "DISK_FULL",
                               "CASE_NOT_FOUND",
                               "TOO_MANY_CASES",
                               "CASE_DAMAGED_ON_ITS_WAY",
                               "QUOTA_EXCEEDED",
                               "AUDIT_NOT_WRITTEN",
                               "EXPORT_NOT_FOUND",
                               "TOO_MANY_EXPORTS",
                               "SESSION_MOVED",
                               "WRONG_NODE",
                               "INVALID_REQUEST",
                               "NOT_FOUND",
                               "ALREADY_EXISTS",
                               "LIMIT_EXCEEDED",
                               "STATE_NOT_FIT",
                               "CHANGED_MEANWHILE",
                               "DATA_DAMAGED",
                               "UNAVAILABLE",
                               "CANCELLED",
                               "DEADLINE_PASSED",
                               "PERMISSION_DENIED",
                               "UNAUTHENTICATED",
                               "NOT_IMPLEMENTED",
                               "INTERNAL_ERROR"};
static_assert(kNames.size() == static_cast<size_t>(ErrorReason::kInternalError) + 1);

ErrorReason ReasonOfCode(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return ErrorReason::kInvalidRequest;
    case absl::StatusCode::kNotFound:
      return ErrorReason::kNotFound;
    case absl::StatusCode::kAlreadyExists:
      return ErrorReason::kAlreadyExists;
    case absl::StatusCode::kResourceExhausted:
      return ErrorReason::kLimitExceeded;
    case absl::StatusCode::kFailedPrecondition:
      return ErrorReason::kStateNotFit;
    case absl::StatusCode::kAborted:
      return ErrorReason::kChangedMeanwhile;
    case absl::StatusCode::kDataLoss:
      return ErrorReason::kDataDamaged;
    case absl::StatusCode::kUnavailable:
      return ErrorReason::kUnavailable;
    case absl::StatusCode::kCancelled:
      return ErrorReason::kCancelled;
    case absl::StatusCode::kDeadlineExceeded:
      return ErrorReason::kDeadlinePassed;
    case absl::StatusCode::kPermissionDenied:
      return ErrorReason::kPermissionDenied;
    case absl::StatusCode::kUnauthenticated:
      return ErrorReason::kUnauthenticated;
    case absl::StatusCode::kUnimplemented:
      return ErrorReason::kNotImplemented;
    default:
      return ErrorReason::kInternalError;
  }
}

// The reason, then a line "key=value" for each fact.
absl::Cord ToPayload(const ErrorInfo& info) {
  std::string text = info.reason;
  for (const auto& [key, value] : info.metadata) absl::StrAppend(&text, "\n", key, "=", value);
  return absl::Cord(text);
}

ErrorInfo FromPayload(const absl::Cord& payload) {
  const std::vector<std::string> lines = absl::StrSplit(std::string(payload), '\n');
  ErrorInfo info{.reason = lines.front(), .metadata = {}};
  for (size_t i = 1; i < lines.size(); ++i) {
    std::pair<std::string, std::string> fact = absl::StrSplit(lines[i], absl::MaxSplits('=', 1));
    info.metadata.insert(std::move(fact));
  }
  return info;
}

}  // namespace

absl::string_view ReasonName(ErrorReason reason) { return kNames[static_cast<size_t>(reason)]; }

std::vector<absl::string_view> AllReasonNames() { return {kNames.begin(), kNames.end()}; }

absl::Status WithReason(absl::Status status, ErrorReason reason, const ErrorMetadata& metadata) {
  return WithErrorInfo(std::move(status), {std::string(ReasonName(reason)), metadata});
}

absl::Status WithErrorInfo(absl::Status status, const ErrorInfo& info) {
  status.SetPayload(kPayloadUrl, ToPayload(info));  // does nothing to an OK status
  return status;
}

ErrorInfo ErrorInfoOf(const absl::Status& status) {
  if (status.ok()) return {};
  if (const auto payload = status.GetPayload(kPayloadUrl); payload.has_value()) {
    return FromPayload(*payload);
  }
  return {.reason = std::string(ReasonName(ReasonOfCode(status.code()))), .metadata = {}};
}

std::string ReasonOf(const absl::Status& status) { return ErrorInfoOf(status).reason; }

bool HasReason(const absl::Status& status, ErrorReason reason) {
  return ReasonOf(status) == ReasonName(reason);
}

}  // namespace tissueform
