// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "server/platform/storage/client_messages.h"

namespace tissueform {

// What the stores refuse, in the same words for every kind of storage.

absl::Status NoSession(absl::string_view id);      // NotFound
absl::Status SessionExists(absl::string_view id);  // AlreadyExists
// OK when a write made from version `etag` (empty: from any) under `epoch` may follow what is kept;
// otherwise FailedPrecondition (the epoch is older), then Aborted (the etag is another).
absl::Status CheckSessionWrite(absl::string_view id, absl::string_view etag, int64_t epoch,
                               absl::string_view kept_etag, int64_t kept_epoch);
// InvalidArgument when there is neither no pose nor one a handle.
absl::Status CheckPoseCount(absl::string_view id, size_t poses, size_t handles);

absl::Status NoMesh(absl::string_view sha256);                        // NotFound
absl::Status MeshHasSessions(int64_t sessions);                       // FailedPrecondition
absl::Status NoPrediction(absl::string_view id);                      // NotFound
absl::Status NoCase(absl::string_view sha256);                        // NotFound
absl::Status TooManyCases(int most);                                  // ResourceExhausted
absl::Status PredictionExists(absl::string_view id);                  // AlreadyExists
absl::Status NoUpload(absl::string_view sha256);                      // NotFound
absl::Status BadLimit(int limit);                                     // InvalidArgument
absl::Status CheckMeshName(absl::string_view sha256);                 // InvalidArgument: no SHA-256
absl::Status Damaged(absl::string_view what, absl::string_view why);  // DataLoss

// WithClientMessage for a database that several servers share, whose address the message contains.
// The sentence follows from the code where none is given.
absl::Status HidingDatabase(absl::Status status, absl::string_view sentence = "");

}  // namespace tissueform
