// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/platform/http/http_client.h"

namespace tissueform {

// GET without a form, otherwise POST of it.
struct LoginRequest {
  std::string url;
  HttpForm form = {};
};

// Makes a request and waits for its answer, of any HTTP status. Errors: Unavailable, with the
// host's name and the cause.
using LoginExchange = std::function<absl::StatusOr<HttpAnswer>(const LoginRequest& request)>;

// Over the network, by the proxy that the environment names: follows no redirect, takes 256 KiB at
// most, ends within 30 s. Trusts the system's certificate authorities. REQUIRES: CheckLoginUrl.
absl::StatusOr<HttpAnswer> AskProvider(const LoginRequest& request);

// That `url` is one to which secrets may go: https, or http of this machine; without a password,
// printable, 2 KiB at most. Errors: InvalidArgument, which names `what` it is.
absl::Status CheckLoginUrl(const std::string& what, const std::string& url);

}  // namespace tissueform
