// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/http/http_client.h"

#include <algorithm>
#include <array>
#include <memory>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include <curl/curl.h>

#include "core/base/status_macros.h"
#include "server/platform/http/curl_handle.h"

namespace tissueform {
namespace {

constexpr std::array<absl::string_view, 3> kThisMachine = {"localhost", "127.0.0.1", "[::1]"};

struct FreeUrl {
  void operator()(CURLU* url) const { curl_url_cleanup(url); }
};
struct FreeHeaders {
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
};
struct FreeText {
  void operator()(char* text) const { curl_free(text); }
};

std::string PartOf(CURLU* url, CURLUPart part) {
  char* text = nullptr;
  if (curl_url_get(url, part, &text, 0) != CURLUE_OK) return {};
  const std::unique_ptr<char, FreeText> owned(text);
  return text;
}

// libcurl's callbacks know the transfer alone.
struct Transfer {
  CURL* handle = nullptr;
  const HttpRequest* request = nullptr;
  HttpAnswer answer = {};
  bool is_too_large = false;
};

void ReadHead(Transfer* transfer) {
  long status = 0;
  const char* type = nullptr;
  curl_easy_getinfo(transfer->handle, CURLINFO_RESPONSE_CODE, &status);
  curl_easy_getinfo(transfer->handle, CURLINFO_CONTENT_TYPE, &type);
  transfer->answer.status = static_cast<int>(status);
  transfer->answer.content_type = type == nullptr ? "" : type;
}

// Fewer bytes than were given end the transfer.
size_t TakeBody(const char* bytes, size_t /*one*/, size_t size, void* data) {
  auto* const transfer = static_cast<Transfer*>(data);
  HttpAnswer& answer = transfer->answer;
  if (answer.status == 0) ReadHead(transfer);
  if (transfer->request->sink) return transfer->request->sink(&answer, {bytes, size}) ? size : 0;
  transfer->is_too_large = answer.body.size() + size > transfer->request->max_body_bytes;
  if (transfer->is_too_large) return 0;
  answer.body.append(bytes, size);
  return size;
}

void SetLimits(const HttpRequest& request, CURL* handle) {
  curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(handle, CURLOPT_FOLLOWLOCATION, 0L);
  if (!request.use_proxy) curl_easy_setopt(handle, CURLOPT_PROXY, "");
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT, static_cast<long>(request.connect_time.count()));
  curl_easy_setopt(handle, CURLOPT_TIMEOUT, static_cast<long>(request.total_time.count()));
  if (request.silence_time.count() > 0) {
    curl_easy_setopt(handle, CURLOPT_LOW_SPEED_LIMIT, 1L);
    curl_easy_setopt(handle, CURLOPT_LOW_SPEED_TIME,
                     static_cast<long>(request.silence_time.count()));
  }
}

void SetContent(Transfer* transfer, curl_slist* headers) {
  CURL* const handle = transfer->handle;
  const HttpRequest& request = *transfer->request;
  curl_easy_setopt(handle, CURLOPT_URL, request.url.c_str());
  curl_easy_setopt(handle, CURLOPT_HTTPHEADER, headers);
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, &TakeBody);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, transfer);
  if (request.body == nullptr) return;
  curl_easy_setopt(handle, CURLOPT_POST, 1L);
  curl_easy_setopt(handle, CURLOPT_POSTFIELDS, request.body->data());
  curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE_LARGE,
                   static_cast<curl_off_t>(request.body->size()));
}

absl::Status ErrorOf(const Transfer& transfer, CURLcode code) {
  if (transfer.is_too_large) {
    return absl::OutOfRangeError(
        absl::StrCat("the answer is larger than ", transfer.request->max_body_bytes, " bytes"));
  }
  return CurlError(code);
}

}  // namespace

bool UrlFacts::IsConfidential() const {
  const bool is_here =
      std::find(kThisMachine.begin(), kThisMachine.end(), host) != kThisMachine.end();
  return scheme == "https" || (scheme == "http" && is_here);
}

std::optional<UrlFacts> ReadUrl(const std::string& url) {
  const std::unique_ptr<CURLU, FreeUrl> parsed(curl_url());
  if (curl_url_set(parsed.get(), CURLUPART_URL, url.c_str(), 0) != CURLUE_OK) return std::nullopt;
  return UrlFacts{.scheme = PartOf(parsed.get(), CURLUPART_SCHEME),
                  .host = PartOf(parsed.get(), CURLUPART_HOST),
                  .has_login = !PartOf(parsed.get(), CURLUPART_USER).empty() ||
                               !PartOf(parsed.get(), CURLUPART_PASSWORD).empty(),
                  .has_query = !PartOf(parsed.get(), CURLUPART_QUERY).empty()};
}

std::string EncodeForm(const HttpForm& form) {
  std::string text;
  for (const auto& [name, value] : form) {
    const std::unique_ptr<char, FreeText> escaped(
        curl_easy_escape(nullptr, value.data(), static_cast<int>(value.size())));
    absl::StrAppend(&text, text.empty() ? "" : "&", name, "=", escaped.get());
  }
  return text;
}

absl::StatusOr<HttpAnswer> SendHttp(const HttpRequest& request) {
  TF_ASSIGN_OR_RETURN(const CurlHandle handle, MakeCurlHandle(request.stopping));
  std::unique_ptr<curl_slist, FreeHeaders> headers;
  for (const std::string& header : request.headers) {
    headers.reset(curl_slist_append(headers.release(), header.c_str()));
  }
  Transfer transfer = {.handle = handle.get(), .request = &request};
  SetLimits(request, handle.get());
  SetCurlTls(handle.get(), request.authorities, request.certificate, request.key);
  SetContent(&transfer, headers.get());
  const CURLcode code = curl_easy_perform(handle.get());
  if (code != CURLE_OK) return ErrorOf(transfer, code);
  ReadHead(&transfer);
  return std::move(transfer.answer);
}

}  // namespace tissueform
