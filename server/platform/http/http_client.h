// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

// Requests over HTTP by libcurl, for all programs: an identity provider, a PACS. Thread-safe.
namespace tissueform {

struct UrlFacts {
  std::string scheme;
  std::string host;
  bool has_login = false;  // a user or a password
  bool has_query = false;

  // Whether secrets may go there: https, or http on this machine.
  bool IsConfidential() const;
};

// Nothing if `url` is not a URL with a scheme.
std::optional<UrlFacts> ReadUrl(const std::string& url);

using HttpForm = std::vector<std::pair<std::string, std::string>>;

// As application/x-www-form-urlencoded, in the order of `form`.
std::string EncodeForm(const HttpForm& form);

struct HttpAnswer {
  int status = 0;
  std::string content_type = {};
  std::string body = {};
};

struct HttpRequest {
  std::string url;
  std::vector<std::string> headers = {};  // "Name: value"; "Name:" leaves a header of libcurl out
  const std::string* body = nullptr;      // null: GET; otherwise POST
  bool use_proxy = false;                 // the one that the environment names

  // PEM files. Without authorities the system's count; without a certificate we show none.
  std::string authorities = {};
  std::string certificate = {};
  std::string key = {};

  std::chrono::seconds connect_time{10};
  std::chrono::seconds total_time{0};    // 0: no limit
  std::chrono::seconds silence_time{0};  // without a byte in either direction; 0: no limit
  size_t max_body_bytes = 0;             // of an answer without a sink

  // Takes the body piece by piece; `answer` has the status and the content type, and its body is
  // the sink's to fill. False ends the exchange.
  std::function<bool(HttpAnswer* answer, absl::string_view piece)> sink = nullptr;
  // Ends the exchange within a second of being true. Null: nothing ends it.
  const std::atomic<bool>* stopping = nullptr;
};

// Makes one request by http or https (TLS 1.2 and later) and waits for its answer, of any status.
// Follows no redirect.
//
// Errors, whose messages name neither the URL nor what was sent: DeadlineExceeded (a time limit),
// Unauthenticated (certificates), OutOfRange (more than max_body_bytes), Cancelled (the sink or
// `stopping`), otherwise Unavailable. REQUIRES: ReadUrl(request.url)->IsConfidential().
absl::StatusOr<HttpAnswer> SendHttp(const HttpRequest& request);

}  // namespace tissueform
