// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/export/sealed_payload.h"

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <zlib.h>

#include "absl/strings/escaping.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include <openssl/evp.h>

#include "core/mesh/payload/sha256.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kData[] = "a face, a face, a face, a face, a face and a chin";
constexpr char kPassword[] = "correct horse bättery";

std::string Gunzip(const std::string& packed) {
  z_stream stream = {};
  inflateInit2(&stream, 15 + 16);
  std::string out(1000, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int result = inflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return result == Z_STREAM_END ? out : "not gzip";
}

const unsigned char* Bytes(const std::string& text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

std::string FromBase64(const json& text) {
  std::string out;
  EXPECT_TRUE(absl::Base64Unescape(text.get<std::string>(), &out));
  return out;
}

// By what the envelope says; nothing where the tag does not fit.
std::optional<std::string> Decrypt(const SealedPayload& sealed, const std::string& password) {
  const json encryption = json::parse(sealed.envelope).at("encryption");
  const std::string salt = FromBase64(encryption.at("salt"));
  const std::string nonce = FromBase64(encryption.at("nonce"));
  std::array<unsigned char, 32> key{};
  PKCS5_PBKDF2_HMAC(password.data(), static_cast<int>(password.size()), Bytes(salt),
                    static_cast<int>(salt.size()), encryption.at("rounds"), EVP_sha256(), 32,
                    key.data());
  std::string text = sealed.payload;
  std::string tag = text.substr(text.size() - 16);
  text.resize(text.size() - 16);
  std::string out(text.size(), '\0');
  int count = 0;
  const std::unique_ptr<EVP_CIPHER_CTX, decltype(&EVP_CIPHER_CTX_free)> context(
      EVP_CIPHER_CTX_new(), EVP_CIPHER_CTX_free);
  EVP_DecryptInit_ex(context.get(), EVP_aes_256_gcm(), nullptr, key.data(), Bytes(nonce));
  EVP_DecryptUpdate(context.get(), reinterpret_cast<unsigned char*>(out.data()), &count,
                    Bytes(text), static_cast<int>(text.size()));
  EVP_CIPHER_CTX_ctrl(context.get(), EVP_CTRL_GCM_SET_TAG, 16, tag.data());
  const bool fits =
      EVP_DecryptFinal_ex(context.get(), reinterpret_cast<unsigned char*>(out.data()), &count) == 1;
  return fits ? std::optional(out) : std::nullopt;
}

TEST(SealedPayloadTest, WithoutAPasswordItIsGzipWithItsDigest) {
  ASSERT_OK_AND_ASSIGN(const SealedPayload sealed, SealPayload(kData, ""));
  const json envelope = json::parse(sealed.envelope);
  EXPECT_EQ(envelope.at("bytes"), sealed.payload.size());
  EXPECT_EQ(envelope.at("sha256"), Sha256Hex({sealed.payload}));
  EXPECT_FALSE(envelope.contains("encryption"));
  EXPECT_EQ(Gunzip(sealed.payload), kData);
}

TEST(SealedPayloadTest, ThePasswordOpensItAndNoOtherDoes) {
  ASSERT_OK_AND_ASSIGN(SealedPayload sealed, SealPayload(kData, kPassword));
  const json encryption = json::parse(sealed.envelope).at("encryption");
  EXPECT_EQ(encryption.at("cipher"), "AES-256-GCM");
  EXPECT_EQ(encryption.at("derivation"), "PBKDF2-SHA-256");
  EXPECT_EQ(encryption.at("rounds"), 600'000);
  EXPECT_EQ(json::parse(sealed.envelope).at("sha256"), Sha256Hex({sealed.payload}));
  EXPECT_EQ(Gunzip(Decrypt(sealed, kPassword).value_or("")), kData);
  EXPECT_EQ(Decrypt(sealed, "correct horse battery"), std::nullopt);
  sealed.payload[3] = static_cast<char>(sealed.payload[3] ^ 1);
  EXPECT_EQ(Decrypt(sealed, kPassword), std::nullopt);
}

TEST(SealedPayloadTest, SaltAndNonceAreNewEveryTime) {
  ASSERT_OK_AND_ASSIGN(const SealedPayload first, SealPayload(kData, kPassword));
  ASSERT_OK_AND_ASSIGN(const SealedPayload second, SealPayload(kData, kPassword));
  const json one = json::parse(first.envelope).at("encryption");
  const json other = json::parse(second.envelope).at("encryption");
  EXPECT_NE(one.at("salt"), other.at("salt"));
  EXPECT_NE(one.at("nonce"), other.at("nonce"));
  EXPECT_NE(first.payload, second.payload);
}

TEST(SealedPayloadTest, RefusesAPayloadTooLargeForAPage) {
  EXPECT_THAT(SealPayload(std::string(kMaxMovingDataBytes + 1, 'x'), ""),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("fewer triangles")));
}

class PasswordFileTest : public CliTest {};

TEST_F(PasswordFileTest, AcceptsAnyLineEnding) {
  for (const char* end : {"", "\n", "\r\n"}) {
    Write("password", std::string(kPassword) + end);
    EXPECT_EQ(ReadPasswordFile(Path("password")).value_or(""), kPassword);
  }
}

TEST_F(PasswordFileTest, RefusesAnInvalidPasswordWithoutQuotingIt) {
  const std::string bad[] = {"", "secret!", "secret words\nmore", "secret \xff words",
                             std::string(kMaxPasswordBytes + 1, 's')};
  for (const std::string& text : bad) {
    Write("password", text);
    EXPECT_THAT(ReadPasswordFile(Path("password")),
                StatusIs(kInvalid, AllOf(HasSubstr("one line"), Not(HasSubstr("secret")))));
  }
  EXPECT_THAT(ReadPasswordFile(Path("none")), StatusIs(absl::StatusCode::kNotFound));
}

}  // namespace
}  // namespace tissueform::testing
