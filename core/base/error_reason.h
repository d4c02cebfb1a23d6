// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

// Why something failed, by a name that programs may decide by: codes are too few, and messages are
// for people and may change. A status carries it as a payload; the server sends it as a
// google.rpc.ErrorInfo, and the client library puts it back (docs/service-api.md has them all).
namespace tissueform {

enum class ErrorReason {
  // What a client decides by. Set where the error is made.
  kMeshNotFound,
  kSessionNotFound,
  kSessionIdTaken,
  kRequestIdReused,
  kSessionBeingDeleted,
  kWatchNotFound,
  kTooManySessions,
  kTooManyStreams,
  kTooManyWatches,
  kMemoryBudgetFull,
  kMeshTooLarge,
  kServerDraining,
  kMeshDamagedOnItsWay,
  kChunkOutOfPlace,
  kUploadSilent,
  kNoConfigurationInTime,
  kPoseSequenceNotRising,
  kNoPreparedAnswers,
  kNotPositiveDefinite,
  kStaleEtag,
  kSessionUpdated,
  kMeshInUse,
  kPredictionNotFound,
  kNotComparable,
  kUploadNotFound,
  kUploadUnderWay,
  kDiskFull,
  kCaseNotFound,
  kTooManyCases,
  kCaseDamagedOnItsWay,
  kQuotaExceeded,
  kAuditNotWritten,
  kExportNotFound,
  kTooManyExports,
  kSessionMoved,
  kWrongNode,
  // Of a code, where nothing more was said.
  kInvalidRequest,
  kNotFound,
  kAlreadyExists,
  kLimitExceeded,
  kStateNotFit,
  kChangedMeanwhile,
  kDataDamaged,
  kUnavailable,
  kCancelled,
  kDeadlinePassed,
  kPermissionDenied,
  kUnauthenticated,
  kNotImplemented,
  kInternalError,
};

// As it is sent: "MESH_NOT_FOUND". Names never change their meaning.
absl::string_view ReasonName(ErrorReason reason);
// In the order of the enumeration.
std::vector<absl::string_view> AllReasonNames();

// Facts beside a reason for programs: "limit" = "64".
using ErrorMetadata = std::map<std::string, std::string>;

// What a status says of its reason.
struct ErrorInfo {
  std::string reason;  // one that this program does not know, when a newer server said it
  ErrorMetadata metadata;
};

// `status` with this reason, in place of another one. Values may not hold line feeds. An OK status
// stays as it is.
absl::Status WithReason(absl::Status status, ErrorReason reason,
                        const ErrorMetadata& metadata = {});
absl::Status WithErrorInfo(absl::Status status, const ErrorInfo& info);

// What was set, or the reason of the code; empty of an OK status.
ErrorInfo ErrorInfoOf(const absl::Status& status);
std::string ReasonOf(const absl::Status& status);
bool HasReason(const absl::Status& status, ErrorReason reason);

}  // namespace tissueform
