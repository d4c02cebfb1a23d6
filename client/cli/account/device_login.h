// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "absl/status/statusor.h"

#include "client/cli/account/login_exchange.h"

namespace tissueform {

// At which identity provider, and as which client of it.
struct LoginClient {
  std::string issuer;
  std::string client_id;
  std::string audience = {};  // empty: the provider's choice
  std::string scopes = "openid";
};

struct LoginTokens {
  std::string access_token = {};
  std::string refresh_token = {};    // empty: none
  std::chrono::seconds lifetime{0};  // 0: not reported
};

// What the user gets to see: where to go, and what to enter there.
struct DevicePrompt {
  std::string url;
  std::string user_code;
  std::string complete_url = {};  // with the code in it; empty: none
  std::chrono::seconds lifetime{0};
};

// The device authorization grant (RFC 8628) and the refresh of what it gave, as a public client.
// Where the provider's endpoints are is asked of its discovery document. One thread.
class DeviceLogin {
 public:
  // `wait` is given the time between two questions.
  using Wait = std::function<void(std::chrono::seconds)>;
  DeviceLogin(LoginClient client, LoginExchange exchange, Wait wait);

  // Shows `prompt` to the user, and waits until the user has completed the login.
  //
  // Errors: InvalidArgument (issuer), Unavailable (the provider does not answer),
  // FailedPrecondition (it has no device flow), PermissionDenied (it, or the user, has refused),
  // DeadlineExceeded (the code has expired), DataLoss (an invalid answer).
  absl::StatusOr<LoginTokens> Run(const std::function<void(const DevicePrompt&)>& prompt);

  // Another token for `refresh_token`; its own refresh token is `refresh_token` where none came.
  // The same errors.
  absl::StatusOr<LoginTokens> Renew(const std::string& refresh_token);

 private:
  struct Endpoints;
  struct Begun;

  absl::StatusOr<Endpoints> Discover();
  absl::StatusOr<Begun> Begin(const std::string& endpoint);
  absl::StatusOr<LoginTokens> Poll(const std::string& endpoint, const Begun& begun);
  HttpForm Form() const;

  const LoginClient client_;
  const LoginExchange exchange_;
  const Wait wait_;
};

}  // namespace tissueform
