// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cli/account/device_login.h"

namespace tissueform {

// What a login leaves: the token alone in the file that the other commands read, and beside it, in
// FILE.renewal, what another token is made from. Both only for their owner (0600), both in full or
// not at all.
struct KeptLogin {
  LoginClient client;
  std::string refresh_token;
};

// Creates the folder (0700) if it is missing. Without a refresh token no FILE.renewal is left.
//
// Errors: as WriteFileAtomically.
absl::Status KeepLogin(const std::string& path, const LoginClient& client,
                       const LoginTokens& tokens);

// Errors: NotFound (no user has logged in, or the provider's tokens cannot be renewed),
// FailedPrecondition (others may read the file), DataLoss (it is damaged).
absl::StatusOr<KeptLogin> ReadLogin(const std::string& path);

// True when there was something. Errors: what the system says.
absl::StatusOr<bool> RemoveLogin(const std::string& path);

}  // namespace tissueform
