// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/token_file.h"

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"
#include <sys/stat.h>

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr int kOwnFile = 0600;
constexpr uintmax_t kMaxFileBytes = uintmax_t{64} << 10;

std::string RenewalPath(const std::string& path) { return path + ".renewal"; }

absl::Status MakeOwnFolder(const fs::path& folder) {
  std::error_code error;
  if (folder.empty() || fs::is_directory(folder, error)) return absl::OkStatus();
  fs::create_directories(folder.parent_path(), error);
  if (mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot create the folder ", folder.string()));
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> Remove(const std::string& path) {
  if (unlink(path.c_str()) == 0) return true;
  if (errno == ENOENT) return false;
  return absl::ErrnoToStatus(errno, absl::StrCat("cannot remove ", path));
}

std::string Text(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

absl::Status KeepLogin(const std::string& path, const LoginClient& client,
                       const LoginTokens& tokens) {
  TF_RETURN_IF_ERROR(MakeOwnFolder(fs::path(path).parent_path()));
  if (tokens.refresh_token.empty()) {
    TF_RETURN_IF_ERROR(Remove(RenewalPath(path)).status());
  } else {
    const nlohmann::json json = {{"issuer", client.issuer},
                                 {"client_id", client.client_id},
                                 {"audience", client.audience},
                                 {"scope", client.scopes},
                                 {"refresh_token", tokens.refresh_token}};
    TF_RETURN_IF_ERROR(
        WriteFileAtomically(RenewalPath(path), absl::StrCat(json.dump(2), "\n"), kOwnFile));
  }
  return WriteFileAtomically(path, absl::StrCat(tokens.access_token, "\n"), kOwnFile);
}

absl::StatusOr<KeptLogin> ReadLogin(const std::string& path) {
  const std::string renewal = RenewalPath(path);
  struct stat facts = {};
  if (stat(renewal.c_str(), &facts) != 0) {
    return absl::NotFoundError(absl::StrCat("nothing to renew: there is no ", renewal,
                                            "; log in with `tissueform login --issuer URL`"));
  }
  if ((facts.st_mode & 0077U) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(renewal, " can be read by other users: chmod 600 it, or log in again"));
  }
  std::ifstream file(renewal, std::ios::binary);
  const bool fits = static_cast<uintmax_t>(facts.st_size) <= kMaxFileBytes;
  const std::string text = fits ? std::string(std::istreambuf_iterator<char>(file), {}) : "";
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  KeptLogin login = {.client = {.issuer = Text(json, "issuer"),
                                .client_id = Text(json, "client_id"),
                                .audience = Text(json, "audience"),
                                .scopes = Text(json, "scope")},
                     .refresh_token = Text(json, "refresh_token")};
  if (login.client.issuer.empty() || login.refresh_token.empty()) {
    return absl::DataLossError(absl::StrCat(renewal, " is damaged: log in again"));
  }
  return login;
}

absl::StatusOr<bool> RemoveLogin(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const bool had_renewal, Remove(RenewalPath(path)));
  TF_ASSIGN_OR_RETURN(const bool had_token, Remove(path));
  return had_renewal || had_token;
}

}  // namespace tissueform
