// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include <curl/curl.h>

// What requests and streams by libcurl have in common; only for the .cc files of this folder.
namespace tissueform {

struct FreeCurlHandle {
  void operator()(CURL* handle) const { curl_easy_cleanup(handle); }
};
using CurlHandle = std::unique_ptr<CURL, FreeCurlHandle>;

// A handle that uses no signals and ends within a second of `stopping` being true (null: never).
// Errors: Unavailable: libcurl does not start.
absl::StatusOr<CurlHandle> MakeCurlHandle(const std::atomic<bool>* stopping);

// TLS 1.2 and later with PEM files, as HttpRequest describes them.
void SetCurlTls(CURL* handle, const std::string& authorities, const std::string& certificate,
                const std::string& key);

// DeadlineExceeded (a time limit), Unauthenticated (certificates), Cancelled (`stopping`),
// otherwise Unavailable, with libcurl's words.
absl::Status CurlError(CURLcode code);

}  // namespace tissueform
