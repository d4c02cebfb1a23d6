// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/verification_key.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include <openssl/bn.h>
#include <openssl/core_names.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/param_build.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include "core/base/status_macros.h"
#include "server/access/auth/token_text.h"

namespace tissueform {
namespace {

constexpr int kMinRsaBits = 2048;
constexpr int kMaxRsaBits = 8192;     // a larger one would only cost time
constexpr int kMaxExponentBits = 64;  // the same
constexpr size_t kP256Bytes = 32;
constexpr size_t kMaxPemKeys = 100;
constexpr char kP256[] = "prime256v1";

template <auto kFree>
struct Free {
  template <typename Object>
  void operator()(Object* object) const {
    kFree(object);
  }
};
using BigNumber = std::unique_ptr<BIGNUM, Free<BN_free>>;
using DigestContext = std::unique_ptr<EVP_MD_CTX, Free<EVP_MD_CTX_free>>;

const unsigned char* Bytes(absl::string_view text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

BigNumber ToNumber(absl::string_view bytes) {
  return BigNumber(BN_bin2bn(Bytes(bytes), static_cast<int>(bytes.size()), nullptr));
}

BigNumber NumberOf(const EVP_PKEY* key, const char* name) {
  BIGNUM* number = nullptr;
  EVP_PKEY_get_bn_param(key, name, &number);
  return BigNumber(number);
}

std::string InBase64(const BigNumber& number, size_t min_bytes) {
  std::string bytes(std::max<size_t>(BN_num_bytes(number.get()), min_bytes), '\0');
  BN_bn2binpad(number.get(), reinterpret_cast<unsigned char*>(bytes.data()),
               static_cast<int>(bytes.size()));
  return absl::WebSafeBase64Escape(bytes);
}

EVP_PKEY* FromParameters(const char* type, OSSL_PARAM_BLD* builder) {
  const std::unique_ptr<OSSL_PARAM, Free<OSSL_PARAM_free>> parameters(
      OSSL_PARAM_BLD_to_param(builder));
  const std::unique_ptr<EVP_PKEY_CTX, Free<EVP_PKEY_CTX_free>> context(
      EVP_PKEY_CTX_new_from_name(nullptr, type, nullptr));
  EVP_PKEY* key = nullptr;
  if (parameters == nullptr || context == nullptr || EVP_PKEY_fromdata_init(context.get()) != 1 ||
      EVP_PKEY_fromdata(context.get(), &key, EVP_PKEY_PUBLIC_KEY, parameters.get()) != 1) {
    ERR_clear_error();
    return nullptr;
  }
  return key;
}

absl::Status CheckRsa(const EVP_PKEY* key) {
  const int bits = EVP_PKEY_get_bits(key);
  if (bits < kMinRsaBits || bits > kMaxRsaBits) {
    return absl::InvalidArgumentError(absl::StrCat("an RSA key has ", bits, " bits; it must have ",
                                                   kMinRsaBits, " to ", kMaxRsaBits));
  }
  const BigNumber exponent = NumberOf(key, OSSL_PKEY_PARAM_RSA_E);
  if (exponent == nullptr || !BN_is_odd(exponent.get()) || BN_is_one(exponent.get()) ||
      BN_num_bits(exponent.get()) > kMaxExponentBits) {
    return absl::InvalidArgumentError("an RSA key has an invalid exponent; use 65537");
  }
  return absl::OkStatus();
}

absl::Status CheckP256(EVP_PKEY* key) {
  std::array<char, 64> group{};
  size_t size = 0;
  if (EVP_PKEY_get_group_name(key, group.data(), group.size(), &size) != 1 ||
      absl::string_view(group.data(), size) != kP256) {
    return absl::InvalidArgumentError("a key uses another curve than P-256; use P-256");
  }
  const std::unique_ptr<EVP_PKEY_CTX, Free<EVP_PKEY_CTX_free>> context(
      EVP_PKEY_CTX_new_from_pkey(nullptr, key, nullptr));
  if (context == nullptr || EVP_PKEY_public_check(context.get()) != 1) {
    ERR_clear_error();
    return absl::InvalidArgumentError("a key is not a point of P-256");
  }
  return absl::OkStatus();
}

std::string RsaThumbprint(const EVP_PKEY* key) {
  return absl::WebSafeBase64Escape(Sha256Bytes(absl::StrCat(
      R"({"e":")", InBase64(NumberOf(key, OSSL_PKEY_PARAM_RSA_E), 1), R"(","kty":"RSA","n":")",
      InBase64(NumberOf(key, OSSL_PKEY_PARAM_RSA_N), 1), R"("})")));
}

std::string P256Thumbprint(const EVP_PKEY* key) {
  return absl::WebSafeBase64Escape(Sha256Bytes(
      absl::StrCat(R"({"crv":"P-256","kty":"EC","x":")",
                   InBase64(NumberOf(key, OSSL_PKEY_PARAM_EC_PUB_X), kP256Bytes), R"(","y":")",
                   InBase64(NumberOf(key, OSSL_PKEY_PARAM_EC_PUB_Y), kP256Bytes), R"("})")));
}

// OpenSSL wants ASN.1. Empty: `signature` is not r and s.
std::string ToDer(absl::string_view signature) {
  if (signature.size() != 2 * kP256Bytes) return {};
  const std::unique_ptr<ECDSA_SIG, Free<ECDSA_SIG_free>> pair(ECDSA_SIG_new());
  BigNumber r = ToNumber(signature.substr(0, kP256Bytes));
  BigNumber s = ToNumber(signature.substr(kP256Bytes));
  if (pair == nullptr || r == nullptr || s == nullptr) return {};
  ECDSA_SIG_set0(pair.get(), r.release(), s.release());
  std::array<unsigned char, 2 * kP256Bytes + 16> der{};
  unsigned char* end = der.data();
  const int size = i2d_ECDSA_SIG(pair.get(), &end);
  return size > 0 ? std::string(der.data(), der.data() + size) : std::string();
}

struct PemBlock {
  std::string name;
  std::string content;
};

// What follows; empty at the end, and where the text is damaged.
std::optional<PemBlock> NextBlock(BIO* text) {
  char* name = nullptr;
  char* header = nullptr;
  unsigned char* content = nullptr;
  long size = 0;
  if (PEM_read_bio(text, &name, &header, &content, &size) != 1) return std::nullopt;
  PemBlock block{.name = name, .content = std::string(content, content + size)};
  OPENSSL_free(name);
  OPENSSL_free(header);
  OPENSSL_free(content);
  return block;
}

}  // namespace

absl::string_view AlgorithmName(TokenAlgorithm algorithm) {
  return algorithm == TokenAlgorithm::kRs256 ? "RS256" : "ES256";
}

struct VerificationKey::Evp {
  std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>> key;
};

VerificationKey::VerificationKey(std::unique_ptr<Evp> evp, TokenAlgorithm algorithm,
                                 std::string thumbprint)
    : evp_(std::move(evp)), algorithm_(algorithm), thumbprint_(std::move(thumbprint)) {}

VerificationKey::~VerificationKey() = default;

absl::StatusOr<VerificationKey::Pointer> VerificationKey::FromEvp(std::unique_ptr<Evp> evp) {
  EVP_PKEY* key = evp->key.get();
  if (key != nullptr && EVP_PKEY_is_a(key, "RSA")) {
    TF_RETURN_IF_ERROR(CheckRsa(key));
    std::string thumbprint = RsaThumbprint(key);
    return Pointer(
        new VerificationKey(std::move(evp), TokenAlgorithm::kRs256, std::move(thumbprint)));
  }
  if (key != nullptr && EVP_PKEY_is_a(key, "EC")) {
    TF_RETURN_IF_ERROR(CheckP256(key));
    std::string thumbprint = P256Thumbprint(key);
    return Pointer(
        new VerificationKey(std::move(evp), TokenAlgorithm::kEs256, std::move(thumbprint)));
  }
  return absl::InvalidArgumentError("a key is neither RSA nor P-256; use one of them");
}

absl::StatusOr<VerificationKey::Pointer> VerificationKey::FromRsa(absl::string_view modulus,
                                                                  absl::string_view exponent) {
  if (modulus.size() > kMaxRsaBits / 8 || exponent.size() > kMaxExponentBits / 8) {
    return absl::InvalidArgumentError("an RSA key is too large");
  }
  const BigNumber n = ToNumber(modulus);
  const BigNumber e = ToNumber(exponent);
  const std::unique_ptr<OSSL_PARAM_BLD, Free<OSSL_PARAM_BLD_free>> builder(OSSL_PARAM_BLD_new());
  OSSL_PARAM_BLD_push_BN(builder.get(), OSSL_PKEY_PARAM_RSA_N, n.get());
  OSSL_PARAM_BLD_push_BN(builder.get(), OSSL_PKEY_PARAM_RSA_E, e.get());
  auto evp = std::make_unique<Evp>();
  evp->key.reset(FromParameters("RSA", builder.get()));
  return FromEvp(std::move(evp));
}

absl::StatusOr<VerificationKey::Pointer> VerificationKey::FromP256(absl::string_view x,
                                                                   absl::string_view y) {
  if (x.size() != kP256Bytes || y.size() != kP256Bytes) {
    return absl::InvalidArgumentError("a key's x and y must be 32 bytes each");
  }
  const std::string point = absl::StrCat("\x04", x, y);  // uncompressed
  const std::unique_ptr<OSSL_PARAM_BLD, Free<OSSL_PARAM_BLD_free>> builder(OSSL_PARAM_BLD_new());
  OSSL_PARAM_BLD_push_utf8_string(builder.get(), OSSL_PKEY_PARAM_GROUP_NAME, kP256, 0);
  OSSL_PARAM_BLD_push_octet_string(builder.get(), OSSL_PKEY_PARAM_PUB_KEY, point.data(),
                                   point.size());
  auto evp = std::make_unique<Evp>();
  evp->key.reset(FromParameters("EC", builder.get()));
  if (evp->key == nullptr) return absl::InvalidArgumentError("a key is not a point of P-256");
  return FromEvp(std::move(evp));
}

absl::StatusOr<std::vector<VerificationKey::Pointer>> VerificationKey::FromPem(
    absl::string_view text) {
  if (absl::StrContains(text, "PRIVATE KEY")) {
    return absl::InvalidArgumentError("it contains a private key; keep only the public key");
  }
  const std::unique_ptr<BIO, Free<BIO_free_all>> bio(
      BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  std::vector<Pointer> keys;
  while (const std::optional<PemBlock> block = NextBlock(bio.get())) {
    if (keys.size() == kMaxPemKeys) return absl::InvalidArgumentError("there are too many keys");
    if (block->name != PEM_STRING_PUBLIC) {
      return absl::InvalidArgumentError("it contains something other than public keys; remove it");
    }
    const unsigned char* bytes = Bytes(block->content);
    auto evp = std::make_unique<Evp>();
    evp->key.reset(d2i_PUBKEY(nullptr, &bytes, static_cast<long>(block->content.size())));
    TF_ASSIGN_OR_RETURN(keys.emplace_back(), FromEvp(std::move(evp)));
  }
  const bool whole = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  ERR_clear_error();
  if (!keys.empty() && whole) return keys;
  return absl::InvalidArgumentError("no `-----BEGIN PUBLIC KEY-----`, or the key is damaged");
}

bool VerificationKey::Verifies(absl::string_view signed_text, absl::string_view signature) const {
  std::string der;
  if (algorithm_ == TokenAlgorithm::kEs256) {
    der = ToDer(signature);
    if (der.empty()) return false;
    signature = der;
  }
  const DigestContext context(EVP_MD_CTX_new());
  const bool verified =
      context != nullptr &&
      EVP_DigestVerifyInit(context.get(), nullptr, EVP_sha256(), nullptr, evp_->key.get()) == 1 &&
      EVP_DigestVerify(context.get(), Bytes(signature), signature.size(), Bytes(signed_text),
                       signed_text.size()) == 1;
  ERR_clear_error();
  return verified;
}

}  // namespace tissueform
