// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/store/case_store.h"

// What a call names, once it is known that its caller may have it: read from its name, asked for at
// `access`, set in the scope.
namespace tissueform {

// The id, or the SHA-256. Errors: InvalidArgument (no such name), those of Access.
absl::StatusOr<std::string> AllowedSession(Access* access, CallScope* scope,
                                           const std::string& name, Permission need);
absl::StatusOr<std::string> AllowedPrediction(Access* access, CallScope* scope,
                                              const std::string& name, Permission need);
absl::StatusOr<std::string> AllowedMesh(Access* access, CallScope* scope, const std::string& name,
                                        Permission need);
absl::StatusOr<CaseKey> AllowedCase(Access* access, CallScope* scope, const std::string& name,
                                    Permission need);

}  // namespace tissueform
