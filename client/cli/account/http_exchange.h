// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

using HttpForm = std::vector<std::pair<std::string, std::string>>;

// GET without a form, else POST of it.
struct HttpRequest {
  std::string url;
  HttpForm form = {};
};

struct HttpAnswer {
  int status = 0;
  std::string body = {};
};

// Makes a request and waits for its answer, whatever its status. Errors: Unavailable, with the
// host's name and what stood in the way.
using HttpExchange = std::function<absl::StatusOr<HttpAnswer>(const HttpRequest& request)>;

// By libcurl: asks the URL and nobody else (no redirects), takes 256 KiB at most, ends within 30 s.
// The system's certificates decide whom to trust. REQUIRES: CheckLoginUrl.
HttpExchange CurlExchange();

// That `url` is one to which secrets may go: https, or http of this machine; without a password,
// printable, 2 KiB at most. Errors: InvalidArgument, which names `what` it is.
absl::Status CheckLoginUrl(const std::string& what, const std::string& url);

}  // namespace tissueform
