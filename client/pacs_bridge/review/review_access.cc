// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/review/review_access.h"

#include <filesystem>
#include <fstream>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace tissueform {
namespace {

constexpr size_t kLeastPasswordCharacters = 16;
constexpr size_t kMaxPasswordBytes = 4096;

// NAME:PASSWORD of HTTP Basic; empty where it is not that.
std::string DecodedBasic(absl::string_view authorization) {
  std::string decoded;
  const bool is_basic = absl::ConsumePrefix(&authorization, "Basic ") &&
                        absl::Base64Unescape(authorization, &decoded);
  return is_basic ? decoded : std::string();
}

}  // namespace

bool IsSameSecret(const std::string& given, const std::string& secret) {
  unsigned difference = given.size() == secret.size() ? 0 : 1;
  for (size_t i = 0; i < given.size(); ++i) {
    difference |= static_cast<unsigned char>(given[i]) ^
                  static_cast<unsigned char>(secret[i % secret.size()]);
  }
  return difference == 0;
}

bool IsLoopbackAddress(const std::string& address) {
  return absl::StartsWith(address, "127.") || address == "::1" || address == "localhost";
}

absl::StatusOr<std::string> ReadReviewPassword(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::is_regular_file(status)) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " cannot be read; write the review page's password to it"));
  }
  if ((status.permissions() & (fs::perms::group_all | fs::perms::others_all)) != fs::perms::none) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " can be read by other users; chmod 600 it"));
  }
  std::ifstream file(path);
  std::string password(kMaxPasswordBytes, '\0');
  file.read(password.data(), static_cast<std::streamsize>(password.size()));
  password.resize(static_cast<size_t>(file.gcount()));
  absl::StripAsciiWhitespace(&password);
  if (password.size() >= kLeastPasswordCharacters) return password;
  return absl::InvalidArgumentError(absl::StrCat(path, " has fewer than ", kLeastPasswordCharacters,
                                                 " characters; write a longer password to it"));
}

std::string HostWithoutPort(const std::string& host) {
  if (absl::StartsWith(host, "[")) return host.substr(0, host.find(']') + 1);
  return host.substr(0, host.find(':'));
}

std::string BasicName(const std::string& authorization) {
  const std::string decoded = DecodedBasic(authorization);
  return decoded.substr(0, decoded.find(':'));
}

bool IsBasicPassword(const std::string& authorization, const std::string& password) {
  const std::string decoded = DecodedBasic(authorization);
  const size_t colon = decoded.find(':');
  return colon != std::string::npos && IsSameSecret(decoded.substr(colon + 1), password);
}

}  // namespace tissueform
