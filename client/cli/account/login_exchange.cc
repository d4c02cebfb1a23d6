// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/login_exchange.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

constexpr size_t kMaxUrlBytes = 2048;
constexpr size_t kMaxAnswerBytes = size_t{256} << 10;
constexpr std::chrono::seconds kDeadline{30};

bool IsPrintable(const std::string& text) {
  return std::all_of(text.begin(), text.end(),
                     [](char letter) { return absl::ascii_isgraph(letter); });
}

}  // namespace

absl::StatusOr<HttpAnswer> AskProvider(const LoginRequest& request) {
  const std::string form = EncodeForm(request.form);
  absl::StatusOr<HttpAnswer> answer = SendHttp({.url = request.url,
                                                .body = request.form.empty() ? nullptr : &form,
                                                .use_proxy = true,
                                                .connect_time = kDeadline,
                                                .total_time = kDeadline,
                                                .max_body_bytes = kMaxAnswerBytes});
  if (answer.ok()) return answer;
  const std::optional<UrlFacts> url = ReadUrl(request.url);
  return absl::UnavailableError(absl::StrCat("the identity provider ", url ? url->host : "",
                                             " cannot be reached: ", answer.status().message(),
                                             "; check --issuer and the network"));
}

absl::Status CheckLoginUrl(const std::string& what, const std::string& url) {
  const std::optional<UrlFacts> facts = ReadUrl(url);
  if (!facts || facts->host.empty() || facts->has_login || !facts->IsConfidential() ||
      !IsPrintable(url) || url.size() > kMaxUrlBytes) {
    return absl::InvalidArgumentError(absl::StrCat(
        what, " is not a login URL: use https://HOST[:PORT][/PATH] (http on loopback)"));
  }
  return absl::OkStatus();
}

}  // namespace tissueform
