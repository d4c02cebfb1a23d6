// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/token_work.h"

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <unistd.h>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/time.h"
#include <openssl/rand.h>
#include <openssl/sha.h>

#include "client/cli/account/signing_key.h"
#include "client/cli/account/token_times.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr mode_t kOwnerOnly = 0600;
constexpr mode_t kEverybodyReads = 0644;
constexpr size_t kMaxFileBytes = 65536;
constexpr size_t kIdBytes = 16;

absl::Status WriteNewFile(const std::filesystem::path& path, mode_t mode,
                          const std::string& content) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  if (file < 0 && errno == EEXIST) {
    return absl::AlreadyExistsError(
        absl::StrCat(path.string(), " exists; delete it or name another folder"));
  }
  if (file < 0) return absl::ErrnoToStatus(errno, absl::StrCat("cannot make ", path.string()));
  const ssize_t written = write(file, content.data(), content.size());
  const bool whole = close(file) == 0 && written == static_cast<ssize_t>(content.size());
  return whole ? absl::OkStatus()
               : absl::ErrnoToStatus(errno, absl::StrCat("cannot write ", path.string()));
}

absl::StatusOr<std::string> ReadSmallFile(const std::string& path, const char* advice) {
  std::ifstream file(path, std::ios::binary);
  std::string text(kMaxFileBytes, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.gcount() <= 0) {
    return absl::NotFoundError(absl::StrCat("cannot read ", path, "; ", advice));
  }
  text.resize(static_cast<size_t>(file.gcount()));
  return text;
}

nlohmann::json OneOrList(const std::vector<std::string>& words) {
  return words.size() == 1 ? nlohmann::json(words.front()) : nlohmann::json(words);
}

absl::StatusOr<nlohmann::json> ReadPart(absl::string_view part, absl::string_view name) {
  std::string text;
  nlohmann::json read;
  if (absl::WebSafeBase64Unescape(part, &text)) {
    read = nlohmann::json::parse(text, nullptr, false);
  }
  if (read.is_object()) return read;
  return absl::InvalidArgumentError(
      absl::StrCat("not a JSON Web Token: its ", name, " is not JSON in base64url"));
}

}  // namespace

nlohmann::json ClaimsOf(const TokenWords& words, std::chrono::system_clock::time_point now) {
  std::array<unsigned char, kIdBytes> id{};
  RAND_bytes(id.data(), static_cast<int>(id.size()));
  const int64_t seconds = absl::ToUnixSeconds(absl::FromChrono(now));
  nlohmann::json claims = {
      {"iss", words.issuer},
      {"aud", OneOrList(words.audiences)},
      {"sub", words.subject},
      {"iat", seconds},
      {"exp", seconds + words.lifetime_seconds},
      {"jti", absl::BytesToHexString({reinterpret_cast<const char*>(id.data()), id.size()})}};
  if (!words.roles.empty()) claims["tissueform_roles"] = words.roles;
  if (!words.projects.empty()) claims["tissueform_projects"] = words.projects;
  return claims;
}

absl::Status MakeKeyFiles(const std::string& folder, int rsa_bits) {
  TF_ASSIGN_OR_RETURN(const SigningKey key,
                      rsa_bits == 0 ? SigningKey::MakeP256() : SigningKey::MakeRsa(rsa_bits));
  std::error_code error;
  const std::filesystem::path path(folder);
  std::filesystem::create_directories(path, error);
  if (error) {
    return absl::UnknownError(absl::StrCat("cannot make ", folder, ": ", error.message()));
  }
  TF_RETURN_IF_ERROR(WriteNewFile(path / "private.pem", kOwnerOnly, key.PrivatePem()));
  TF_RETURN_IF_ERROR(WriteNewFile(path / "public.pem", kEverybodyReads, key.PublicPem()));
  return WriteNewFile(path / "jwks.json", kEverybodyReads, key.PublicJwks().dump(2) + "\n");
}

absl::StatusOr<std::string> MakeTokenWith(const std::string& key_file, const TokenWords& words) {
  TF_ASSIGN_OR_RETURN(
      const std::string pem,
      ReadSmallFile(key_file, "create keys with `tissueform token keygen --out DIR`"));
  const absl::StatusOr<SigningKey> key = SigningKey::FromPem(pem);
  if (!key.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(key_file, ": ", key.status().message()));
  }
  return key->MakeToken(ClaimsOf(words, std::chrono::system_clock::now()));
}

absl::StatusOr<nlohmann::json> ShowTokenFile(const std::string& path,
                                             std::chrono::system_clock::time_point now) {
  TF_ASSIGN_OR_RETURN(const std::string text,
                      ReadSmallFile(path, "give a token file, as written by `tissueform login`"));
  absl::StatusOr<nlohmann::json> shown = ShowToken(absl::StripAsciiWhitespace(text), now);
  if (shown.ok()) return shown;
  return absl::InvalidArgumentError(absl::StrCat(path, ": ", shown.status().message()));
}

absl::StatusOr<nlohmann::json> ShowToken(absl::string_view token,
                                         std::chrono::system_clock::time_point now) {
  const std::vector<absl::string_view> parts = absl::StrSplit(token, '.');
  if (parts.size() != 3) {
    return absl::InvalidArgumentError("not a JSON Web Token: it does not have three parts");
  }
  nlohmann::json shown;
  TF_ASSIGN_OR_RETURN(shown["header"], ReadPart(parts[0], "header"));
  TF_ASSIGN_OR_RETURN(shown["claims"], ReadPart(parts[1], "claims"));
  const TokenState state = TokenStateAt(shown["claims"], now);
  shown["state"] =
      absl::StrCat(state.date == TokenDate::kInDate ? "in date: " : "not in date: ", state.words,
                   " by this machine's clock");
  shown["times"] = TokenTimesAt(shown["claims"], now);
  const absl::string_view signed_text = token.substr(0, parts[0].size() + 1 + parts[1].size());
  std::array<unsigned char, SHA256_DIGEST_LENGTH> digest{};
  SHA256(reinterpret_cast<const unsigned char*>(signed_text.data()), signed_text.size(),
         digest.data());
  shown["token_digest"] =
      absl::BytesToHexString({reinterpret_cast<const char*>(digest.data()), digest.size()});
  return shown;
}

}  // namespace tissueform
