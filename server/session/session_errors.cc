// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_errors.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"

namespace tissueform {

absl::Status NoSuchSession(const std::string& id) {
  return WithReason(absl::NotFoundError(absl::StrCat(
                        "no session \"sessions/", id,
                        "\": it was deleted, or removed after being idle; create it again")),
                    ErrorReason::kSessionNotFound);
}

absl::Status OtherRequest(const std::string& request_id) {
  return WithReason(
      absl::InvalidArgumentError(absl::StrCat("request_id \"", request_id,
                                              "\" was used for another request; choose a new one")),
      ErrorReason::kRequestIdReused);
}

absl::Status TakenId(const std::string& id) {
  return WithReason(
      absl::AlreadyExistsError(absl::StrCat("a session \"sessions/", id,
                                            "\" exists already; choose another session_id")),
      ErrorReason::kSessionIdTaken);
}

absl::Status EndingId(const std::string& id) {
  return WithReason(
      absl::UnavailableError(
          absl::StrCat("the session \"sessions/", id,
                       "\" is being deleted; try again in a moment, or choose another session_id")),
      ErrorReason::kSessionBeingDeleted);
}

absl::Status SessionMoved(const std::string& node) {
  ErrorMetadata metadata;
  if (!node.empty()) metadata["node"] = node;
  return WithReason(absl::UnavailableError(
                        "another server holds the session, or may hold it; call again, and the "
                        "call reaches that server"),
                    ErrorReason::kSessionMoved, metadata);
}

absl::Status MovedIfFenced(absl::Status status) {
  return absl::IsFailedPrecondition(status) ? SessionMoved("") : std::move(status);
}

absl::Status SessionOutdated() {
  return WithReason(absl::AbortedError("the session has other handles now; open the stream again"),
                    ErrorReason::kSessionUpdated);
}

absl::Status MeshInUse(int sessions) {
  return WithReason(absl::FailedPreconditionError(
                        absl::StrCat(sessions, sessions == 1 ? " session is" : " sessions are",
                                     " made from it; delete them first")),
                    ErrorReason::kMeshInUse, {{"sessions", absl::StrCat(sessions)}});
}

absl::Status NoSuchMesh() {
  return WithReason(absl::NotFoundError("the server does not have this mesh; upload it"),
                    ErrorReason::kMeshNotFound);
}

absl::Status NoMeshAnyMore() {
  return WithReason(absl::NotFoundError("the mesh was deleted; upload it"),
                    ErrorReason::kMeshNotFound);
}

absl::Status TooManySessions(int limit, absl::string_view what, absl::string_view remedy) {
  return WithReason(absl::ResourceExhaustedError(absl::StrCat(
                        "the server ", what, " ", limit, " sessions, which is the limit", remedy)),
                    ErrorReason::kTooManySessions, {{"limit", absl::StrCat(limit)}});
}

}  // namespace tissueform
