// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_options.h"

#include <cstdlib>
#include <fcntl.h>
#include <libpq-fe.h>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include <sys/stat.h>

#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"

namespace tissueform {
namespace {

using Keywords = std::map<std::string, std::string>;

// A connection whose other end is gone without a word is noticed after so long.
constexpr int kIdleSeconds = 5;
constexpr int kProbeSeconds = 2;
constexpr int kProbes = 3;
constexpr int kUnansweredMilliseconds = 10'000;
constexpr int64_t kMaxPasswordBytes = 4096;

absl::StatusOr<Keywords> ParseUrl(const std::string& url) {
  if (!absl::StartsWith(url, "postgresql://") && !absl::StartsWith(url, "postgres://")) {
    return absl::InvalidArgumentError(
        "the store's address is not a database URL; the form is "
        "postgresql://user@host:port/name");
  }
  // What libpq would say of a bad URL holds parts of it: perhaps a password.
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> parsed(
      PQconninfoParse(url.c_str(), nullptr), &PQconninfoFree);
  if (parsed == nullptr) {
    return absl::InvalidArgumentError(
        "the store's address is invalid; the form is "
        "postgresql://user@host:port/name?sslmode=verify-full");
  }
  Keywords keywords;
  for (const PQconninfoOption* option = parsed.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr) keywords[option->keyword] = option->val;
  }
  return keywords;
}

bool IsHere(const std::string& hosts) {
  for (const absl::string_view host : absl::StrSplit(hosts, ',')) {
    if (!host.empty() && host[0] != '/' && host != "localhost" && host != "127.0.0.1" &&
        host != "::1") {
      return false;
    }
  }
  return true;
}

absl::Status ChooseEncryption(Keywords* keywords) {
  std::string& mode = (*keywords)["sslmode"];
  if (mode == "allow" || mode == "prefer") {
    return absl::InvalidArgumentError(
        absl::StrCat("sslmode=", mode, " may be unencrypted; use verify-full, require or disable"));
  }
  // What libpq would find out only when it connects, as if the database were away.
  const std::set<absl::string_view> known = {"", "disable", "require", "verify-ca", "verify-full"};
  if (!known.contains(mode)) {
    return absl::InvalidArgumentError("unknown sslmode; use verify-full, require or disable");
  }
  const std::string& host =
      keywords->contains("hostaddr") ? (*keywords)["hostaddr"] : (*keywords)["host"];
  if (mode.empty()) mode = IsHere(host) ? "prefer" : "verify-full";
  return absl::OkStatus();
}

std::string Quoted(const std::string& value) {
  return absl::StrCat("'", absl::StrReplaceAll(value, {{"\\", "\\\\"}, {"'", "\\'"}}), "'");
}

void AddSettings(const PostgresOptions& options, Keywords* keywords) {
  Keywords& settings = *keywords;
  settings["connect_timeout"] = absl::StrCat(options.connect_timeout.count());
  settings["client_encoding"] = "UTF8";
  settings["keepalives_idle"] = absl::StrCat(kIdleSeconds);
  settings["keepalives_interval"] = absl::StrCat(kProbeSeconds);
  settings["keepalives_count"] = absl::StrCat(kProbes);
  settings["tcp_user_timeout"] = absl::StrCat(kUnansweredMilliseconds);
  // Of several addresses the primary; after a failover that is another one.
  if (!settings.contains("target_session_attrs")) settings["target_session_attrs"] = "read-write";
  if (!settings.contains("application_name")) settings["application_name"] = "tissueform-server";
  absl::StrAppend(&settings["options"], " -c statement_timeout=", options.statement_timeout.count(),
                  " -c lock_timeout=", options.lock_timeout.count(),
                  " -c idle_in_transaction_session_timeout=", options.idle_timeout.count(),
                  " -c default_transaction_isolation=read\\ committed -c "
                  "client_min_messages=warning");
}

}  // namespace

absl::StatusOr<PostgresTarget> TargetOf(const PostgresOptions& options) {
  if (options.max_connections < 1 || options.connect_timeout.count() < 1 ||
      options.statement_timeout.count() < 1 || options.lock_timeout.count() < 1 ||
      options.idle_timeout.count() < 1 || options.unanswered_timeout.count() < 1 ||
      options.patience.count() < 1) {
    return absl::InvalidArgumentError(
        "connections and timeouts of the store's database must be at least 1");
  }
  TF_ASSIGN_OR_RETURN(Keywords keywords, ParseUrl(options.url));
  if (keywords.contains("password")) {
    return absl::InvalidArgumentError(
        "the store's address contains a password, which other users can read; put it in a file or "
        "in "
        "TISSUEFORM_STORE_PASSWORD");
  }
  TF_RETURN_IF_ERROR(ChooseEncryption(&keywords));
  PostgresTarget target;
  target.name =
      absl::StrCat("postgresql://", keywords["host"], keywords.contains("port") ? ":" : "",
                   keywords["port"], "/", keywords["dbname"]);
  if (!options.password.empty()) keywords["password"] = options.password;
  AddSettings(options, &keywords);
  for (const auto& [keyword, value] : keywords) {
    if (!value.empty()) absl::StrAppend(&target.connection, keyword, "=", Quoted(value), " ");
  }
  return target;
}

absl::StatusOr<std::string> ReadPostgresPassword(const std::string& file) {
  if (file.empty()) {
    const char* password = std::getenv("TISSUEFORM_STORE_PASSWORD");
    return password == nullptr ? "" : password;
  }
  TF_ASSIGN_OR_RETURN(const OpenFile opened, OpenFile::Open(file, O_RDONLY));
  struct stat status {};
  if (fstat(opened.descriptor(), &status) != 0 || (status.st_mode & S_IRWXO) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("password file ", file, ": other users can read it; chmod o-rwx it"));
  }
  TF_ASSIGN_OR_RETURN(std::string password, opened.ReadAt(0, kMaxPasswordBytes));
  return std::string(absl::StripSuffix(absl::StripSuffix(password, "\n"), "\r"));
}

}  // namespace tissueform
