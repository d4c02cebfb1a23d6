// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

enum class TokenAlgorithm { kRs256, kEs256 };

// "RS256", "ES256".
absl::string_view AlgorithmName(TokenAlgorithm algorithm);

// A public key, which pins the one algorithm whose signatures it takes: RSA of 2048 to 8192 bits
// RS256, a point of P-256 ES256. Constant; its functions are called from any thread.
class VerificationKey {
 public:
  using Pointer = std::shared_ptr<const VerificationKey>;

  ~VerificationKey();
  VerificationKey(const VerificationKey&) = delete;
  VerificationKey& operator=(const VerificationKey&) = delete;

  // From bytes as a JWK has them, most significant first. Errors: InvalidArgument, saying what is
  // wrong with the key.
  static absl::StatusOr<Pointer> FromRsa(absl::string_view modulus, absl::string_view exponent);
  static absl::StatusOr<Pointer> FromP256(absl::string_view x, absl::string_view y);
  // Of a text that holds one `PUBLIC KEY` after the other. Errors: the same; `text` holds none, or
  // a private one.
  static absl::StatusOr<std::vector<Pointer>> FromPem(absl::string_view text);

  TokenAlgorithm algorithm() const { return algorithm_; }
  // By RFC 7638: the name of a key that has no other.
  const std::string& thumbprint() const { return thumbprint_; }

  // `signature` as a token has it (of ES256: r and s, 32 bytes each).
  bool Verifies(absl::string_view signed_text, absl::string_view signature) const;

 private:
  struct Evp;

  VerificationKey(std::unique_ptr<Evp> evp, TokenAlgorithm algorithm, std::string thumbprint);
  static absl::StatusOr<Pointer> FromEvp(std::unique_ptr<Evp> evp);

  const std::unique_ptr<Evp> evp_;
  const TokenAlgorithm algorithm_;
  const std::string thumbprint_;
};

}  // namespace tissueform
