// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/signing_key.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include <openssl/bn.h>
#include <openssl/core_names.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rsa.h>

namespace tissueform {
namespace {

constexpr size_t kP256Bytes = 32;

template <auto kEnd>
struct EndWith {
  template <typename Object>
  void operator()(Object* object) const {
    kEnd(object);
  }
};
using Memory = std::unique_ptr<BIO, EndWith<BIO_free_all>>;

// Fails only without memory, or without any OpenSSL provider.
void RequireMade(bool made) {
  if (!made) std::abort();
}

std::string TextOf(BIO* memory) {
  char* text = nullptr;
  const long size = BIO_get_mem_data(memory, &text);
  return {text, static_cast<size_t>(size)};
}

std::string Padded(const BIGNUM* number, size_t size) {
  std::string bytes(size, '\0');
  RequireMade(BN_bn2binpad(number, reinterpret_cast<unsigned char*>(bytes.data()),
                           static_cast<int>(size)) >= 0);
  return bytes;
}

std::string NumberInBase64(const EVP_PKEY* key, const char* name, size_t min_bytes) {
  BIGNUM* number = nullptr;
  RequireMade(EVP_PKEY_get_bn_param(key, name, &number) == 1);
  const std::unique_ptr<BIGNUM, EndWith<BN_free>> owned(number);
  return absl::WebSafeBase64Escape(
      Padded(number, std::max<size_t>(BN_num_bytes(number), min_bytes)));
}

// r and s, 32 bytes each, out of ASN.1.
std::string FromDer(const std::string& der) {
  const auto* begin = reinterpret_cast<const unsigned char*>(der.data());
  const std::unique_ptr<ECDSA_SIG, EndWith<ECDSA_SIG_free>> pair(
      d2i_ECDSA_SIG(nullptr, &begin, static_cast<long>(der.size())));
  RequireMade(pair != nullptr);
  return absl::StrCat(Padded(ECDSA_SIG_get0_r(pair.get()), kP256Bytes),
                      Padded(ECDSA_SIG_get0_s(pair.get()), kP256Bytes));
}

int NoPassword(char* /*buffer*/, int /*size*/, int /*writing*/, void* /*data*/) { return -1; }

}  // namespace

struct SigningKey::Evp {
  std::unique_ptr<EVP_PKEY, EndWith<EVP_PKEY_free>> key;
};

SigningKey::SigningKey(std::unique_ptr<Evp> evp) : evp_(std::move(evp)) {}
SigningKey::~SigningKey() = default;
SigningKey::SigningKey(SigningKey&& other) noexcept = default;

absl::StatusOr<SigningKey> SigningKey::MakeP256() {
  auto evp = std::make_unique<Evp>();
  evp->key.reset(EVP_EC_gen("P-256"));
  if (evp->key == nullptr) return absl::InternalError("OpenSSL cannot create a key");
  return SigningKey(std::move(evp));
}

absl::StatusOr<SigningKey> SigningKey::MakeRsa(int bits) {
  auto evp = std::make_unique<Evp>();
  evp->key.reset(EVP_RSA_gen(static_cast<unsigned int>(bits)));
  if (evp->key == nullptr) return absl::InternalError("OpenSSL cannot create a key");
  return SigningKey(std::move(evp));
}

absl::StatusOr<SigningKey> SigningKey::FromPem(absl::string_view text) {
  const Memory memory(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  auto evp = std::make_unique<Evp>();
  evp->key.reset(PEM_read_bio_PrivateKey(memory.get(), nullptr, &NoPassword, nullptr));
  const EVP_PKEY* key = evp->key.get();
  if (key == nullptr) {
    return absl::InvalidArgumentError(
        "it has no private key in PEM without a password; create one with `tissueform token "
        "keygen`");
  }
  if (!EVP_PKEY_is_a(key, "RSA") && !(EVP_PKEY_is_a(key, "EC") && EVP_PKEY_get_bits(key) == 256)) {
    return absl::InvalidArgumentError("the key is neither RSA nor P-256");
  }
  return SigningKey(std::move(evp));
}

bool SigningKey::is_rsa() const { return EVP_PKEY_is_a(evp_->key.get(), "RSA") == 1; }

std::string SigningKey::algorithm() const { return is_rsa() ? "RS256" : "ES256"; }

std::string SigningKey::PrivatePem() const {
  const Memory memory(BIO_new(BIO_s_mem()));
  RequireMade(PEM_write_bio_PKCS8PrivateKey(memory.get(), evp_->key.get(), nullptr, nullptr, 0,
                                            nullptr, nullptr) == 1);
  return TextOf(memory.get());
}

std::string SigningKey::PublicPem() const {
  const Memory memory(BIO_new(BIO_s_mem()));
  RequireMade(PEM_write_bio_PUBKEY(memory.get(), evp_->key.get()) == 1);
  return TextOf(memory.get());
}

// What the thumbprint is of. nlohmann writes members by their names, rising, as RFC 7638 wants it.
nlohmann::json SigningKey::PublicNumbers() const {
  const EVP_PKEY* key = evp_->key.get();
  if (is_rsa()) {
    return {{"kty", "RSA"},
            {"n", NumberInBase64(key, OSSL_PKEY_PARAM_RSA_N, 1)},
            {"e", NumberInBase64(key, OSSL_PKEY_PARAM_RSA_E, 1)}};
  }
  return {{"kty", "EC"},
          {"crv", "P-256"},
          {"x", NumberInBase64(key, OSSL_PKEY_PARAM_EC_PUB_X, kP256Bytes)},
          {"y", NumberInBase64(key, OSSL_PKEY_PARAM_EC_PUB_Y, kP256Bytes)}};
}

std::string SigningKey::kid() const {
  const std::string text = PublicNumbers().dump();
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  RequireMade(EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr) ==
              1);
  return absl::WebSafeBase64Escape(
      absl::string_view(reinterpret_cast<const char*>(digest.data()), size));
}

nlohmann::json SigningKey::PublicJwks() const {
  nlohmann::json key = PublicNumbers();
  key["kid"] = kid();
  key["use"] = "sig";
  key["alg"] = algorithm();
  return {{"keys", nlohmann::json::array({std::move(key)})}};
}

std::string SigningKey::Sign(absl::string_view text) const {
  const std::unique_ptr<EVP_MD_CTX, EndWith<EVP_MD_CTX_free>> context(EVP_MD_CTX_new());
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  std::string signature(EVP_PKEY_get_size(evp_->key.get()), '\0');
  size_t size = signature.size();
  RequireMade(EVP_DigestSignInit(context.get(), nullptr, EVP_sha256(), nullptr, evp_->key.get()) ==
                  1 &&
              EVP_DigestSign(context.get(), reinterpret_cast<unsigned char*>(signature.data()),
                             &size, bytes, text.size()) == 1);
  signature.resize(size);
  return is_rsa() ? signature : FromDer(signature);
}

std::string SigningKey::MakeToken(const nlohmann::json& header,
                                  const nlohmann::json& claims) const {
  const std::string text = absl::StrCat(absl::WebSafeBase64Escape(header.dump()), ".",
                                        absl::WebSafeBase64Escape(claims.dump()));
  return absl::StrCat(text, ".", absl::WebSafeBase64Escape(Sign(text)));
}

std::string SigningKey::MakeToken(const nlohmann::json& claims) const {
  return MakeToken({{"alg", algorithm()}, {"kid", kid()}, {"typ", "JWT"}}, claims);
}

}  // namespace tissueform
