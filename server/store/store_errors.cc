// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/store_errors.h"

#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/store/mesh_store.h"
#include "server/store/prediction_store.h"
#include "server/store/session_store.h"

namespace tissueform {
namespace {

const char* SentenceOf(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kUnavailable:
      return "the server's database does not answer; try again in a minute";
    case absl::StatusCode::kResourceExhausted:
      return "the disk of the server's database is full; tell the server's operator";
    case absl::StatusCode::kFailedPrecondition:
      return "the server's database is read-only now; tell the server's operator";
    default:
      return "the server's database has failed; tell the server's operator";
  }
}

}  // namespace

absl::Status NoSession(absl::string_view id) {
  return WithReason(absl::NotFoundError(absl::StrCat("no record of session \"", id, "\"")),
                    ErrorReason::kSessionNotFound);
}

absl::Status SessionExists(absl::string_view id) {
  return WithReason(absl::AlreadyExistsError(
                        absl::StrCat("a session \"", id, "\" exists already; choose another id")),
                    ErrorReason::kSessionIdTaken);
}

absl::Status CheckSessionWrite(absl::string_view id, absl::string_view etag, int64_t epoch,
                               absl::string_view kept_etag, int64_t kept_epoch) {
  if (epoch < kept_epoch) {
    return absl::FailedPreconditionError(absl::StrCat("epoch ", epoch, " of session \"", id,
                                                      "\" has ended, it is ", kept_epoch,
                                                      " now: another server has taken it"));
  }
  if (!etag.empty() && etag != kept_etag) {
    return WithReason(
        absl::AbortedError(absl::StrCat("session \"", id, "\" has changed; get it and try again")),
        ErrorReason::kStaleEtag);
  }
  return absl::OkStatus();
}

absl::Status CheckPoseCount(absl::string_view id, size_t poses, size_t handles) {
  if (poses == 0 || poses == handles) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("session \"", id, "\" has ", handles,
                                                 " handles, not ", poses,
                                                 "; commit one pose per handle, or none for rest"));
}

absl::Status MeshHasSessions(int64_t sessions) {
  return WithReason(absl::FailedPreconditionError(
                        absl::StrCat(sessions, sessions == 1 ? " session is" : " sessions are",
                                     " made from it; delete them first")),
                    ErrorReason::kMeshInUse, {{"sessions", absl::StrCat(sessions)}});
}

absl::Status NoMesh(absl::string_view sha256) {
  return WithReason(absl::NotFoundError(absl::StrCat("no mesh ", sha256, " is stored; upload it")),
                    ErrorReason::kMeshNotFound);
}

absl::Status NoPrediction(absl::string_view id) {
  return WithReason(absl::NotFoundError(absl::StrCat("no prediction \"", id, "\"")),
                    ErrorReason::kPredictionNotFound);
}

absl::Status NoCase(absl::string_view sha256) {
  return WithReason(absl::NotFoundError(absl::StrCat("no case ", sha256, " is stored; upload it")),
                    ErrorReason::kCaseNotFound);
}

absl::Status TooManyCases(int most) {
  return WithReason(
      absl::ResourceExhaustedError(absl::StrCat(
          "the server keeps ", most, " cases, which is the limit (max_cases); delete some")),
      ErrorReason::kTooManyCases, {{"limit", absl::StrCat(most)}});
}

absl::Status PredictionExists(absl::string_view id) {
  return absl::AlreadyExistsError(
      absl::StrCat("a prediction \"", id, "\" exists already; choose another id"));
}

absl::Status NoUpload(absl::string_view sha256) {
  return WithReason(absl::NotFoundError(absl::StrCat("no upload of ", sha256, " exists; start it")),
                    ErrorReason::kUploadNotFound);
}

absl::Status BadLimit(int limit) {
  return absl::InvalidArgumentError(absl::StrCat("limit is ", limit, "; it must be at least 1"));
}

absl::Status CheckMeshName(absl::string_view sha256) {
  if (IsSha256Hex(sha256)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "a mesh is named by its SHA-256, 64 lower-case hexadecimal digits");
}

absl::Status Damaged(absl::string_view what, absl::string_view why) {
  return absl::DataLossError(absl::StrCat(what, " is damaged: ", why));
}

absl::Status CheckMeshRecord(const MeshRecord& record, const MeshPayloadView& payload) {
  TF_RETURN_IF_ERROR(CheckMeshName(record.sha256));
  size_t bytes = 0;
  for (const absl::string_view segment : payload.segments) bytes += segment.size();
  const bool same_shape = record.shape.num_vertices == payload.shape.num_vertices &&
                          record.shape.num_tets == payload.shape.num_tets &&
                          record.shape.cell_arrays == payload.shape.cell_arrays;
  if (!same_shape || record.total_bytes < 0 || static_cast<size_t>(record.total_bytes) != bytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("the record of mesh ", record.sha256, " does not match its payload"));
  }
  return absl::OkStatus();
}

absl::Status CheckPrediction(const PredictionRecord& record, const std::string& positions) {
  if (record.id.empty()) return absl::InvalidArgumentError("a prediction needs an id");
  const auto bytes = static_cast<int64_t>(positions.size());
  if (bytes % kVertexBytes != 0 || bytes / kVertexBytes != record.vertex_count) {
    return absl::InvalidArgumentError(absl::StrCat("prediction \"", record.id, "\" has ", bytes,
                                                   " bytes of positions for ", record.vertex_count,
                                                   " vertices; it needs 12 per vertex"));
  }
  return absl::OkStatus();
}

absl::Status HidingDatabase(absl::Status status, absl::string_view sentence) {
  const absl::StatusCode code = status.code();
  return WithClientMessage(std::move(status), sentence.empty() ? SentenceOf(code) : sentence);
}

int64_t SystemUnixSeconds() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::seconds>(now).count();
}

}  // namespace tissueform
