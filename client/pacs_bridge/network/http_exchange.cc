// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/http_exchange.h"

#include <cstddef>
#include <optional>

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

constexpr size_t kMaxErrorBytes = 64 << 10;
constexpr int kHttpOk = 200;

absl::Status TransferFailed(const PacsPeer& peer, const absl::Status& error) {
  const std::string where = absl::StrCat("the PACS '", peer.name, "': ", error.message());
  if (absl::IsDeadlineExceeded(error)) {
    return absl::DeadlineExceededError(where + ": is it busy? try again");
  }
  if (absl::IsUnauthenticated(error)) {
    return absl::UnauthenticatedError(where + ": compare certificates and authorities");
  }
  return absl::UnavailableError(where + ": is it running there? try again");
}

}  // namespace

absl::Status CheckPacsUrl(const PacsPeer& peer) {
  const std::optional<UrlFacts> facts = ReadUrl(peer.url);
  if (!facts || facts->has_query) {
    return absl::InvalidArgumentError(
        absl::StrCat("the PACS '", peer.name, "': it has no URL; write https://HOST/dicom-web"));
  }
  if (facts->has_login) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the PACS '", peer.name, "': its URL holds a user or password; use a certificate"));
  }
  if (facts->IsConfidential()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "the PACS '", peer.name, "': its URL must be https; patients' data go nowhere unencrypted"));
}

absl::StatusOr<HttpAnswer> Exchange(const PacsPeer& peer, const PacsHttpRequest& request,
                                    const TakeBody& take) {
  absl::Status taken;
  HttpRequest sent = {.url = absl::StrCat(peer.url, request.path),
                      .headers = request.headers,
                      .body = request.body,
                      .connect_time = peer.connect_time,
                      .silence_time = peer.answer_time};
  if (peer.tls) {
    sent.authorities = peer.tls->authorities;
    sent.certificate = peer.tls->certificate;
    sent.key = peer.tls->key;
  }
  sent.sink = [&](HttpAnswer* answer, absl::string_view piece) {
    if (answer->status == kHttpOk) {
      taken = take(answer->content_type, piece);
      return taken.ok();
    }
    const absl::string_view kept = piece.substr(0, kMaxErrorBytes - answer->body.size());
    answer->body.append(kept.data(), kept.size());
    return true;
  };
  absl::StatusOr<HttpAnswer> answer = SendHttp(sent);
  if (!taken.ok()) return taken;
  if (!answer.ok()) return TransferFailed(peer, answer.status());
  return answer;
}

}  // namespace tissueform
