// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/http/curl_handle.h"

#include <mutex>

namespace tissueform {
namespace {

int EndWhenStopping(void* stopping, curl_off_t /*of*/, curl_off_t /*down*/, curl_off_t /*to*/,
                    curl_off_t /*up*/) {
  return *static_cast<const std::atomic<bool>*>(stopping) ? 1 : 0;
}

}  // namespace

absl::StatusOr<CurlHandle> MakeCurlHandle(const std::atomic<bool>* stopping) {
  static std::once_flag once;
  std::call_once(once, [] { curl_global_init(CURL_GLOBAL_DEFAULT); });
  CurlHandle handle(curl_easy_init());
  if (handle == nullptr) return absl::UnavailableError("libcurl does not start");
  curl_easy_setopt(handle.get(), CURLOPT_NOSIGNAL, 1L);
  if (stopping == nullptr) return handle;
  curl_easy_setopt(handle.get(), CURLOPT_NOPROGRESS, 0L);
  curl_easy_setopt(handle.get(), CURLOPT_XFERINFOFUNCTION, &EndWhenStopping);
  curl_easy_setopt(handle.get(), CURLOPT_XFERINFODATA, stopping);
  return handle;
}

void SetCurlTls(CURL* handle, const std::string& authorities, const std::string& certificate,
                const std::string& key) {
  curl_easy_setopt(handle, CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
  if (!authorities.empty()) curl_easy_setopt(handle, CURLOPT_CAINFO, authorities.c_str());
  if (certificate.empty()) return;
  curl_easy_setopt(handle, CURLOPT_SSLCERT, certificate.c_str());
  curl_easy_setopt(handle, CURLOPT_SSLKEY, key.c_str());
}

absl::Status CurlError(CURLcode code) {
  const char* const text = curl_easy_strerror(code);
  switch (code) {
    case CURLE_OPERATION_TIMEDOUT:
      return absl::DeadlineExceededError(text);
    case CURLE_SSL_CONNECT_ERROR:
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CERTPROBLEM:
    case CURLE_SSL_CACERT_BADFILE:
    case CURLE_SSL_CIPHER:
      return absl::UnauthenticatedError(text);
    case CURLE_WRITE_ERROR:
    case CURLE_ABORTED_BY_CALLBACK:
      return absl::CancelledError(text);
    default:
      return absl::UnavailableError(text);
  }
}

}  // namespace tissueform
