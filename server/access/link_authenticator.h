// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/access/access.h"
#include "server/access/auth/authenticator.h"

namespace tissueform {

// A new token of a follow link: "tfl_" and 256 random bits.
std::string NewLinkToken();
// By what the server knows it.
std::string DigestOfLinkToken(absl::string_view token);

// Knows who comes with a follow link, and asks another authenticator about all others. A link's
// principal is called "link:{id of its session}".
class LinkAuthenticator final : public Authenticator {
 public:
  // Both must outlive it.
  LinkAuthenticator(Access* access, Authenticator* others) : access_(access), others_(others) {}

  absl::StatusOr<Authenticated> Authenticate(const Credentials& credentials) override;
  absl::Status IsStillAuthorized(const Authenticated& authenticated) override;

 private:
  Access* const access_;
  Authenticator* const others_;
};

}  // namespace tissueform
