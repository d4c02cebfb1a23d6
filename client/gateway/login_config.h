// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

namespace tissueform {

// How the planner's page logs its user in: by OpenID Connect, as a public client. The gateway
// passes this to the page and has no other part in it.
struct LoginConfig {
  std::string issuer = {};  // "https://login.example.org/realms/clinic"; empty: no login
  std::string client_id = {};
  std::string audience = {};  // requested audience of tokens; empty: the provider's choice
  std::string scopes = "openid profile";
};

// InvalidArgument, naming the option: an issuer that is no https URL (http on loopback), or has a
// query or fragment; one of issuer and client id without the other.
absl::Status CheckLoginConfig(const LoginConfig& config);

// "https://login.example.org": of an issuer that has been checked. Empty without an issuer.
std::string OriginOfIssuer(const LoginConfig& config);

}  // namespace tissueform
