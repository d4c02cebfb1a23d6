// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_text.h"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_split.h"
#include <openssl/evp.h>

#include "server/access/auth/token_failure.h"

namespace tissueform {
namespace {

constexpr absl::string_view kScheme = "Bearer ";

bool IsBase64Url(absl::string_view text) {
  return std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return absl::ascii_isalnum(c) || c == '-' || c == '_';
  });
}

}  // namespace

absl::StatusOr<absl::string_view> BearerToken(const std::vector<absl::string_view>& headers) {
  if (headers.empty()) return RefuseToken(TokenFailure::kNoToken);
  if (headers.size() > 1) return RefuseToken(TokenFailure::kTwoHeaders);
  absl::string_view token = headers.front();
  if (token.size() > kMaxTokenBytes + kScheme.size()) return RefuseToken(TokenFailure::kTooLong);
  if (!absl::StartsWithIgnoreCase(token, kScheme)) return RefuseToken(TokenFailure::kNotBearer);
  token.remove_prefix(kScheme.size());
  if (token.empty()) return RefuseToken(TokenFailure::kNotBearer);
  return token;
}

absl::StatusOr<TokenParts> SplitToken(absl::string_view token) {
  const std::vector<absl::string_view> parts = absl::StrSplit(token, absl::MaxSplits('.', 3));
  if (parts.size() != 3) return RefuseToken(TokenFailure::kMalformed);
  std::optional<std::string> header = DecodeBase64Url(parts[0]);
  std::optional<std::string> claims = DecodeBase64Url(parts[1]);
  std::optional<std::string> signature = DecodeBase64Url(parts[2]);
  if (!header.has_value() || !claims.has_value() || !signature.has_value()) {
    return RefuseToken(TokenFailure::kMalformed);
  }
  return TokenParts{.header = *std::move(header),
                    .claims = *std::move(claims),
                    .signature = *std::move(signature),
                    .signed_text = token.substr(0, parts[0].size() + 1 + parts[1].size())};
}

std::optional<std::string> DecodeBase64Url(absl::string_view text) {
  std::string bytes;
  // Abseil passes over spaces and takes padding, and bits that no byte holds.
  if (!IsBase64Url(text) || !absl::WebSafeBase64Unescape(text, &bytes) ||
      absl::WebSafeBase64Escape(bytes) != text) {
    return std::nullopt;
  }
  return bytes;
}

std::string Sha256Bytes(absl::string_view bytes) {
  // Fetched once: looking for the algorithm costs more than the digest.
  static const EVP_MD* const sha256 = EVP_MD_fetch(nullptr, "SHA256", nullptr);
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, sha256, nullptr) != 1) {
    std::abort();  // without memory, or without any OpenSSL provider
  }
  return {reinterpret_cast<const char*>(digest.data()), size};
}

std::string TokenDigest(absl::string_view signed_text) {
  return absl::BytesToHexString(Sha256Bytes(signed_text));
}

}  // namespace tissueform
