// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/access/auth/identity.h"

namespace tissueform {

// What a call brings to say who makes it. Views into the call's headers.
struct Credentials {
  std::vector<absl::string_view> authorization = {};  // every header of this name, as it was sent
  // The peer that TLS has identified: the subject names of its certificate, alternatives first;
  // empty without a certificate.
  std::vector<std::string> certificate_names = {};
};

// An identified caller, and how long that identity is valid.
struct Authenticated {
  std::shared_ptr<const Principal> principal = {};  // never null
  std::chrono::system_clock::time_point expires = std::chrono::system_clock::time_point::max();
  // What revocations know it by: the SHA-256 of the signed part of the token; empty: no token.
  std::string token_id = {};
  std::string token_name = {};  // its `jti`; empty: it has none
  // Before all revocations, where the token does not say.
  std::chrono::system_clock::time_point issued = std::chrono::system_clock::time_point::min();
};

// Identifies the caller of each call. Thread-safe; called on gRPC's threads, so it never blocks.
class Authenticator {
 public:
  virtual ~Authenticator() = default;

  // Errors: Unauthenticated, with a sentence that holds nothing of a token whose signature was not
  // verified, and of others issuer, audience and times at most.
  virtual absl::StatusOr<Authenticated> Authenticate(const Credentials& credentials) = 0;

  // Whether a stream that has begun with this may go on: neither expired nor revoked.
  virtual absl::Status IsStillAuthorized(const Authenticated& authenticated) = 0;
};

}  // namespace tissueform
