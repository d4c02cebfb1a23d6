// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/http_exchange.h"

#include <algorithm>
#include <cstddef>
#include <memory>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "curl/curl.h"

namespace tissueform {
namespace {

constexpr size_t kMaxUrlBytes = 2048;
constexpr size_t kMaxAnswerBytes = size_t{256} << 10;
constexpr long kDeadlineSeconds = 30;

using Curl = std::unique_ptr<CURL, decltype(&curl_easy_cleanup)>;
using Url = std::unique_ptr<CURLU, decltype(&curl_url_cleanup)>;

std::string PartOf(const std::string& url, CURLUPart part) {
  const Url parsed(curl_url(), &curl_url_cleanup);
  char* text = nullptr;
  if (parsed == nullptr || curl_url_set(parsed.get(), CURLUPART_URL, url.c_str(), 0) != CURLUE_OK ||
      curl_url_get(parsed.get(), part, &text, 0) != CURLUE_OK) {
    return {};
  }
  std::string value = text;
  curl_free(text);
  return value;
}

bool IsOfThisMachine(const std::string& host) {
  return host == "localhost" || host == "127.0.0.1" || host == "[::1]";
}

size_t Append(const char* bytes, size_t size, size_t count, void* body) {
  auto* const text = static_cast<std::string*>(body);
  // Fewer bytes than were given end the transfer.
  if (text->size() + size * count > kMaxAnswerBytes) return 0;
  text->append(bytes, size * count);
  return size * count;
}

std::string Encoded(CURL* curl, const HttpForm& form) {
  std::string text;
  for (const auto& [name, value] : form) {
    const std::unique_ptr<char, decltype(&curl_free)> escaped(
        curl_easy_escape(curl, value.data(), static_cast<int>(value.size())), &curl_free);
    absl::StrAppend(&text, text.empty() ? "" : "&", name, "=", escaped.get());
  }
  return text;
}

absl::StatusOr<HttpAnswer> Exchange(const HttpRequest& request) {
  const Curl curl(curl_easy_init(), &curl_easy_cleanup);
  if (curl == nullptr) return absl::InternalError("libcurl cannot be initialized");
  HttpAnswer answer;
  const std::string body = Encoded(curl.get(), request.form);
  curl_easy_setopt(curl.get(), CURLOPT_URL, request.url.c_str());
  curl_easy_setopt(curl.get(), CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(curl.get(), CURLOPT_FOLLOWLOCATION, 0L);
  curl_easy_setopt(curl.get(), CURLOPT_TIMEOUT, kDeadlineSeconds);
  curl_easy_setopt(curl.get(), CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(curl.get(), CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
  curl_easy_setopt(curl.get(), CURLOPT_WRITEFUNCTION, &Append);
  curl_easy_setopt(curl.get(), CURLOPT_WRITEDATA, &answer.body);
  if (!request.form.empty()) curl_easy_setopt(curl.get(), CURLOPT_POSTFIELDS, body.c_str());
  const CURLcode code = curl_easy_perform(curl.get());
  if (code != CURLE_OK) {
    return absl::UnavailableError(absl::StrCat(
        "the identity provider ", PartOf(request.url, CURLUPART_HOST),
        " cannot be reached: ", curl_easy_strerror(code), "; check --issuer and the network"));
  }
  long status = 0;
  curl_easy_getinfo(curl.get(), CURLINFO_RESPONSE_CODE, &status);
  answer.status = static_cast<int>(status);
  return answer;
}

}  // namespace

HttpExchange CurlExchange() {
  static const bool ready = curl_global_init(CURL_GLOBAL_DEFAULT) == CURLE_OK;
  if (!ready) {
    return [](const HttpRequest&) -> absl::StatusOr<HttpAnswer> {
      return absl::InternalError("libcurl cannot be initialized");
    };
  }
  return &Exchange;
}

absl::Status CheckLoginUrl(const std::string& what, const std::string& url) {
  const bool printable =
      std::all_of(url.begin(), url.end(), [](char letter) { return absl::ascii_isgraph(letter); });
  const std::string scheme = PartOf(url, CURLUPART_SCHEME);
  const std::string host = PartOf(url, CURLUPART_HOST);
  const bool safe = scheme == "https" || (scheme == "http" && IsOfThisMachine(host));
  if (!printable || url.size() > kMaxUrlBytes || host.empty() || !safe ||
      !PartOf(url, CURLUPART_USER).empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        what, " is not a login URL: use https://HOST[:PORT][/PATH] (http on loopback)"));
  }
  return absl::OkStatus();
}

}  // namespace tissueform
