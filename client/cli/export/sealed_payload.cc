// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/export/sealed_payload.h"

#include <array>
#include <fstream>
#include <memory>
#include <utility>
#include <zlib.h>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/rand.h>

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kSaltBytes = 16;
constexpr size_t kNonceBytes = 12;
constexpr size_t kKeyBytes = 32;
constexpr size_t kTagBytes = 16;
constexpr int kGzipWindow = 15 + 16;  // zlib's largest, and a head of gzip
constexpr int kMaxMemory = 9;

absl::StatusOr<std::string> Gzip(absl::string_view data) {
  z_stream stream = {};
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, kGzipWindow, kMaxMemory,
                   Z_DEFAULT_STRATEGY) != Z_OK) {
    return absl::InternalError("zlib cannot be initialized");
  }
  // 18 bytes for what gzip has around it.
  std::string out(deflateBound(&stream, data.size()) + 18, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(data.data()));
  stream.avail_in = static_cast<uInt>(data.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int result = deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  if (result != Z_STREAM_END) return absl::InternalError("zlib cannot compress the data");
  return out;
}

using Bytes = std::string;

unsigned char* Raw(std::string* bytes) { return reinterpret_cast<unsigned char*>(bytes->data()); }
const unsigned char* Raw(absl::string_view bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

absl::StatusOr<Bytes> RandomBytes(size_t count) {
  Bytes bytes(count, '\0');
  if (RAND_bytes(Raw(&bytes), static_cast<int>(count)) == 1) return bytes;
  return absl::InternalError("OpenSSL cannot generate random numbers");
}

// A key that leaves nothing in memory.
struct SecretKey {
  SecretKey() = default;
  SecretKey(const SecretKey&) = delete;
  SecretKey& operator=(const SecretKey&) = delete;
  ~SecretKey() { OPENSSL_cleanse(bytes.data(), bytes.size()); }

  std::array<unsigned char, kKeyBytes> bytes = {};
};

// The tag stands behind the text, as WebCrypto has it.
absl::StatusOr<Bytes> EncryptGcm(absl::string_view text, const SecretKey& key, const Bytes& nonce) {
  const std::unique_ptr<EVP_CIPHER_CTX, decltype(&EVP_CIPHER_CTX_free)> context(
      EVP_CIPHER_CTX_new(), EVP_CIPHER_CTX_free);
  Bytes out(text.size() + kTagBytes, '\0');
  int written = 0;
  int rest = 0;
  const bool done = context != nullptr &&
                    EVP_EncryptInit_ex(context.get(), EVP_aes_256_gcm(), nullptr, key.bytes.data(),
                                       Raw(absl::string_view(nonce))) == 1 &&
                    EVP_EncryptUpdate(context.get(), Raw(&out), &written, Raw(text),
                                      static_cast<int>(text.size())) == 1 &&
                    EVP_EncryptFinal_ex(context.get(), Raw(&out) + written, &rest) == 1 &&
                    EVP_CIPHER_CTX_ctrl(context.get(), EVP_CTRL_GCM_GET_TAG,
                                        static_cast<int>(kTagBytes), Raw(&out) + text.size()) == 1;
  if (!done) return absl::InternalError("OpenSSL cannot encrypt the data");
  return out;
}

absl::Status DeriveKey(const std::string& password, const Bytes& salt, SecretKey* key) {
  const int done =
      PKCS5_PBKDF2_HMAC(password.data(), static_cast<int>(password.size()),
                        Raw(absl::string_view(salt)), static_cast<int>(salt.size()),
                        kMovingFileKeyRounds, EVP_sha256(), kKeyBytes, key->bytes.data());
  return done == 1 ? absl::OkStatus() : absl::InternalError("OpenSSL cannot derive a key");
}

// Letters, not bytes; nullopt where that is no UTF-8.
bool IsUtf8(const std::string& text) {
  try {
    return !Json(text).dump().empty();
  } catch (const Json::exception&) {
    return false;
  }
}

size_t CountLetters(const std::string& text) {
  size_t count = 0;
  for (const char c : text) count += (static_cast<unsigned char>(c) & 0xC0U) != 0x80U ? 1 : 0;
  return count;
}

}  // namespace

absl::StatusOr<SealedPayload> SealPayload(absl::string_view data, const std::string& password) {
  if (data.size() > kMaxMovingDataBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("surfaces and prepared answers have ", data.size(),
                     " bytes; the limit for a moving file is ", kMaxMovingDataBytes,
                     "; use fewer triangles, or choose another model"));
  }
  SealedPayload sealed;
  TF_ASSIGN_OR_RETURN(sealed.payload, Gzip(data));
  Json encryption;
  if (!password.empty()) {
    TF_ASSIGN_OR_RETURN(const Bytes salt, RandomBytes(kSaltBytes));
    TF_ASSIGN_OR_RETURN(const Bytes nonce, RandomBytes(kNonceBytes));
    SecretKey key;
    TF_RETURN_IF_ERROR(DeriveKey(password, salt, &key));
    TF_ASSIGN_OR_RETURN(sealed.payload, EncryptGcm(sealed.payload, key, nonce));
    encryption = {{"cipher", "AES-256-GCM"},
                  {"derivation", "PBKDF2-SHA-256"},
                  {"rounds", kMovingFileKeyRounds},
                  {"salt", absl::Base64Escape(salt)},
                  {"nonce", absl::Base64Escape(nonce)}};
  }
  Json envelope = {{"format", "tissueform-moving-file"},
                   {"version", 1},
                   {"bytes", sealed.payload.size()},
                   {"sha256", Sha256Hex({sealed.payload})}};
  if (!encryption.is_null()) envelope["encryption"] = encryption;
  sealed.envelope = envelope.dump();
  return sealed;
}

absl::StatusOr<std::string> ReadPasswordFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text(kMaxPasswordBytes + 3, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(file.gcount()));
  if (!file && !file.eof()) {
    return absl::NotFoundError(absl::StrCat("cannot read --password-file ", path));
  }
  if (!text.empty() && text.back() == '\n') text.pop_back();
  if (!text.empty() && text.back() == '\r') text.pop_back();
  if (text.size() > kMaxPasswordBytes || text.find_first_of("\n\r") != std::string::npos ||
      !IsUtf8(text) || CountLetters(text) < kLeastPasswordLetters) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--password-file ", path, ": the password must be one line of UTF-8 with at least ",
        kLeastPasswordLetters, " letters and at most ", kMaxPasswordBytes, " bytes"));
  }
  return text;
}

}  // namespace tissueform
