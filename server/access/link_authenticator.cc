// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/link_authenticator.h"

#include <array>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include <openssl/rand.h>

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/access/access_names.h"

namespace tissueform {
namespace {

constexpr absl::string_view kBearer = "Bearer ";
constexpr absl::string_view kTokenPrefix = "tfl_";
constexpr size_t kTokenBytes = 4 + 43;

// The token, where it is one of a follow link; else empty.
absl::string_view LinkTokenOf(const Credentials& credentials) {
  if (credentials.authorization.size() != 1) return {};
  absl::string_view token = credentials.authorization.front();
  if (!absl::StartsWithIgnoreCase(token, kBearer)) return {};
  token.remove_prefix(kBearer.size());
  return absl::StartsWith(token, kTokenPrefix) ? token : absl::string_view();
}

}  // namespace

std::string NewLinkToken() {
  std::array<unsigned char, 32> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) {
    std::abort();  // a token that can be guessed is worse
  }
  return absl::StrCat(
      kTokenPrefix,
      absl::WebSafeBase64Escape({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
}

std::string DigestOfLinkToken(absl::string_view token) { return Sha256Hex({token}); }

absl::StatusOr<Authenticated> LinkAuthenticator::Authenticate(const Credentials& credentials) {
  const absl::string_view token = LinkTokenOf(credentials);
  if (token.empty()) return others_->Authenticate(credentials);
  if (token.size() != kTokenBytes) {
    return absl::UnauthenticatedError(
        "the follow link is incomplete or changed; open it exactly as sent");
  }
  TF_ASSIGN_OR_RETURN(const FollowLinkRow link, access_->FindLink(DigestOfLinkToken(token)));
  return Authenticated{
      .principal = std::make_shared<const Principal>(
          Principal{.name = absl::StrCat("link:", link.session),
                    .only_session = SessionResource(link.session)}),
      .expires = std::chrono::system_clock::time_point(std::chrono::seconds(link.expires_s)),
      .token_id = link.digest};
}

absl::Status LinkAuthenticator::IsStillAuthorized(const Authenticated& authenticated) {
  if (authenticated.principal->only_session.empty())
    return others_->IsStillAuthorized(authenticated);
  return access_->RecheckLink(authenticated.token_id);
}

}  // namespace tissueform
