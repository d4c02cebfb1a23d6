// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/http_exchange.h"

#include <algorithm>
#include <array>
#include <memory>
#include <mutex>

#include "absl/strings/str_cat.h"
#include <curl/curl.h>

namespace tissueform {
namespace {

constexpr std::array<absl::string_view, 3> kThisMachine = {"localhost", "127.0.0.1", "[::1]"};
constexpr size_t kMaxErrorBytes = 64 << 10;
constexpr int kHttpOk = 200;

struct FreeUrl {
  void operator()(CURLU* url) const { curl_url_cleanup(url); }
};
struct FreeHandle {
  void operator()(CURL* handle) const { curl_easy_cleanup(handle); }
};
struct FreeList {
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
};

std::string PieceOf(CURLU* url, CURLUPart part) {
  char* text = nullptr;
  if (curl_url_get(url, part, &text, 0) != CURLUE_OK) return {};
  std::string copy(text);
  curl_free(text);
  return copy;
}

struct Transfer {
  CURL* handle = nullptr;
  const TakeBody* take = nullptr;
  PacsHttpAnswer answer = {};
  absl::Status status = {};
};

size_t OnBody(const char* bytes, size_t /*one*/, size_t size, void* data) {
  auto* transfer = static_cast<Transfer*>(data);
  if (transfer->answer.status == 0) {
    long status = 0;
    const char* type = nullptr;
    curl_easy_getinfo(transfer->handle, CURLINFO_RESPONSE_CODE, &status);
    curl_easy_getinfo(transfer->handle, CURLINFO_CONTENT_TYPE, &type);
    transfer->answer.status = static_cast<int>(status);
    transfer->answer.content_type = type == nullptr ? "" : type;
  }
  if (transfer->answer.status == kHttpOk) {
    transfer->status = (*transfer->take)(transfer->answer.content_type, {bytes, size});
    return transfer->status.ok() ? size : 0;
  }
  std::string& body = transfer->answer.body;
  body.append(bytes, std::min(size, kMaxErrorBytes - std::min(kMaxErrorBytes, body.size())));
  return size;
}

void SetTls(const PacsPeer& peer, CURL* handle) {
  curl_easy_setopt(handle, CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
  if (!peer.tls) return;
  if (!peer.tls->authorities.empty()) {
    curl_easy_setopt(handle, CURLOPT_CAINFO, peer.tls->authorities.c_str());
  }
  if (!peer.tls->certificate.empty()) {
    curl_easy_setopt(handle, CURLOPT_SSLCERT, peer.tls->certificate.c_str());
    curl_easy_setopt(handle, CURLOPT_SSLKEY, peer.tls->key.c_str());
  }
}

void SetUpRequest(const PacsPeer& peer, const PacsHttpRequest& request, Transfer* transfer,
                  curl_slist* headers) {
  CURL* handle = transfer->handle;
  curl_easy_setopt(handle, CURLOPT_URL, absl::StrCat(peer.url, request.path).c_str());
  curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http,https");  // as CheckPacsUrl allows
  curl_easy_setopt(handle, CURLOPT_FOLLOWLOCATION, 0L);
  curl_easy_setopt(handle, CURLOPT_PROXY, "");
  curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT, static_cast<long>(peer.connect_time.count()));
  curl_easy_setopt(handle, CURLOPT_LOW_SPEED_LIMIT, 1L);
  curl_easy_setopt(handle, CURLOPT_LOW_SPEED_TIME, static_cast<long>(peer.answer_time.count()));
  curl_easy_setopt(handle, CURLOPT_HTTPHEADER, headers);
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, &OnBody);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, transfer);
  if (request.body != nullptr) {
    curl_easy_setopt(handle, CURLOPT_POST, 1L);
    curl_easy_setopt(handle, CURLOPT_POSTFIELDS, request.body->data());
    curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE_LARGE,
                     static_cast<curl_off_t>(request.body->size()));
  }
  SetTls(peer, handle);
}

absl::Status TransferFailed(const PacsPeer& peer, CURLcode code) {
  const std::string where = absl::StrCat("the PACS '", peer.name, "': ", curl_easy_strerror(code));
  switch (code) {
    case CURLE_OPERATION_TIMEDOUT:
      return absl::DeadlineExceededError(where + ": is it busy? try again");
    case CURLE_SSL_CONNECT_ERROR:
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CERTPROBLEM:
    case CURLE_SSL_CACERT_BADFILE:
    case CURLE_SSL_CIPHER:
      return absl::UnauthenticatedError(where + ": compare certificates and authorities");
    default:
      return absl::UnavailableError(where + ": is it running there? try again");
  }
}

}  // namespace

absl::Status CheckPacsUrl(const PacsPeer& peer) {
  const std::unique_ptr<CURLU, FreeUrl> url(curl_url());
  if (curl_url_set(url.get(), CURLUPART_URL, peer.url.c_str(), 0) != CURLUE_OK ||
      !PieceOf(url.get(), CURLUPART_QUERY).empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the PACS '", peer.name, "': it has no URL; write https://HOST/dicom-web"));
  }
  if (!PieceOf(url.get(), CURLUPART_USER).empty() ||
      !PieceOf(url.get(), CURLUPART_PASSWORD).empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the PACS '", peer.name, "': its URL holds a user or password; use a certificate"));
  }
  const std::string scheme = PieceOf(url.get(), CURLUPART_SCHEME);
  const std::string host = PieceOf(url.get(), CURLUPART_HOST);
  const bool here = std::find(kThisMachine.begin(), kThisMachine.end(), host) != kThisMachine.end();
  if (scheme == "https" || (scheme == "http" && here)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "the PACS '", peer.name, "': its URL must be https; patients' data go nowhere unencrypted"));
}

absl::StatusOr<PacsHttpAnswer> Exchange(const PacsPeer& peer, const PacsHttpRequest& request,
                                        const TakeBody& take) {
  static std::once_flag once;
  std::call_once(once, [] { curl_global_init(CURL_GLOBAL_DEFAULT); });
  const std::unique_ptr<CURL, FreeHandle> handle(curl_easy_init());
  if (handle == nullptr) return absl::UnavailableError("libcurl does not start");
  std::unique_ptr<curl_slist, FreeList> headers;
  for (const std::string& header : request.headers) {
    headers.reset(curl_slist_append(headers.release(), header.c_str()));
  }
  Transfer transfer;
  transfer.handle = handle.get();
  transfer.take = &take;
  SetUpRequest(peer, request, &transfer, headers.get());
  const CURLcode code = curl_easy_perform(handle.get());
  if (!transfer.status.ok()) return transfer.status;
  if (code != CURLE_OK) return TransferFailed(peer, code);
  long status = 0;
  curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &status);
  transfer.answer.status = static_cast<int>(status);
  return transfer.answer;
}

}  // namespace tissueform
