// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

namespace tissueform {

// A private key that signs tokens: of P-256 (ES256), or RSA (RS256). Its owner can act as any user.
class SigningKey {
 public:
  ~SigningKey();
  SigningKey(SigningKey&& other) noexcept;
  SigningKey& operator=(SigningKey&&) = delete;

  // Errors: Internal.
  static absl::StatusOr<SigningKey> MakeP256();
  static absl::StatusOr<SigningKey> MakeRsa(int bits);
  // Errors: InvalidArgument: no private key of P-256 or RSA, or one with a password.
  static absl::StatusOr<SigningKey> FromPem(absl::string_view text);

  std::string PrivatePem() const;  // PKCS #8, without a password
  std::string PublicPem() const;
  // {"keys": [...]}: the public keys, for the servers' configuration.
  nlohmann::json PublicJwks() const;

  // "ES256" or "RS256".
  std::string algorithm() const;
  // Its thumbprint by RFC 7638.
  std::string kid() const;

  // As tokens have it, in bytes.
  std::string Sign(absl::string_view text) const;
  // A token in its compact form; the header as it is given.
  std::string MakeToken(const nlohmann::json& header, const nlohmann::json& claims) const;
  // With this key's algorithm and name in the header.
  std::string MakeToken(const nlohmann::json& claims) const;

 private:
  struct Evp;
  explicit SigningKey(std::unique_ptr<Evp> evp);
  bool is_rsa() const;
  nlohmann::json PublicNumbers() const;

  std::unique_ptr<Evp> evp_;  // null: moved from
};

}  // namespace tissueform
