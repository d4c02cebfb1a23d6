// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Nothing of a longer token is looked at.
inline constexpr size_t kMaxTokenBytes = 8192;

// The token of a call's authorization headers; a view into them. Errors: RefuseToken's (none, two
// headers, not `Bearer TOKEN`, too long).
absl::StatusOr<absl::string_view> BearerToken(const std::vector<absl::string_view>& headers);

// A JSON Web Token in its compact form, taken apart but not interpreted.
struct TokenParts {
  std::string header;             // JSON, unless the token is forged
  std::string claims;             // the same
  std::string signature;          // bytes
  absl::string_view signed_text;  // header and claims as they came: what the signature is of
};

// Errors: RefuseToken's (malformed).
absl::StatusOr<TokenParts> SplitToken(absl::string_view token);

// Strict: no padding, no spaces, and no second way to write the same bytes.
std::optional<std::string> DecodeBase64Url(absl::string_view text);

// 32 bytes.
std::string Sha256Bytes(absl::string_view bytes);

// The name of a token in a revocation list: SHA-256 of its signed text, in 64 lower-case
// hexadecimal digits. Not of the whole token: any holder can write an ES256 signature in a second
// way, and the token would then have another name.
std::string TokenDigest(absl::string_view signed_text);

}  // namespace tissueform
