// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

// The errors of calls that use sessions.
namespace tissueform {

absl::Status NoSuchSession(const std::string& id);         // NotFound
absl::Status OtherRequest(const std::string& request_id);  // InvalidArgument: its id was used
absl::Status TakenId(const std::string& id);               // AlreadyExists
absl::Status EndingId(const std::string& id);              // Unavailable: it is being deleted
// Unavailable: this server may not answer it, since another holds it, that node where one is named.
absl::Status SessionMoved(const std::string& node);
// What the store has said of a write under an epoch: SessionMoved where that is an old one.
absl::Status MovedIfFenced(absl::Status status);
absl::Status SessionOutdated();        // Aborted: its handles are others now
absl::Status MeshInUse(int sessions);  // FailedPrecondition
absl::Status NoSuchMesh();             // NotFound
absl::Status NoMeshAnyMore();          // NotFound: it has been deleted since
// ResourceExhausted: what the server does with so many ("keeps"), and what helps.
absl::Status TooManySessions(int limit, absl::string_view what, absl::string_view remedy);

}  // namespace tissueform
