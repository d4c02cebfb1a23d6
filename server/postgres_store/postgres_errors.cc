// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/postgres_errors.h"

#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include <pqxx/pqxx>

#include "server/store/store_errors.h"

namespace tissueform {
namespace {

std::string FirstLine(absl::string_view text) {
  const std::vector<absl::string_view> lines = absl::StrSplit(text, absl::MaxSplits('\n', 1));
  absl::string_view line = absl::StripAsciiWhitespace(lines[0]);
  for (const absl::string_view prefix : {"ERROR:", "FATAL:"}) absl::ConsumePrefix(&line, prefix);
  return std::string(absl::StripAsciiWhitespace(line));
}

constexpr char kSameRows[] = "others change the same things at this moment; try again";

const char* SentenceOf(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kUnavailable:
      return "the server's database does not answer; try again in a minute";
    case absl::StatusCode::kResourceExhausted:
      return "the disk of the server's database is full; tell who operates the server";
    case absl::StatusCode::kFailedPrecondition:
      return "the server's database takes no changes now; tell who operates the server";
    default:
      return "the server's database has failed; tell who operates the server";
  }
}

absl::Status SameRows(const std::string& name) {
  return HidingDatabase(absl::UnavailableError(absl::StrCat(
                            "database ", name, ": others write the same rows; try again")),
                        kSameRows);
}

PostgresFailure LostConnection(const std::string& name, const std::exception& error) {
  return {.status = HidingDatabase(absl::UnavailableError(
              absl::StrCat("database ", name, ": ", FirstLine(error.what())))),
          .transient = true,
          .connected = false};
}

// By SQLSTATE; https://www.postgresql.org/docs/15/errcodes-appendix.html
PostgresFailure FailureOf(const std::string& name, const pqxx::sql_error& error) {
  const std::string& state = error.sqlstate();
  const auto told = [&](const char* what) { return absl::StrCat("database ", name, ": ", what); };
  if (state == "53100") {
    return {
        HidingDatabase(absl::ResourceExhaustedError(told("its disk is full; make room there")))};
  }
  if (state == "25006") {
    // Where a failover has made a replica of what was the primary another connection may find it.
    return {.status = HidingDatabase(absl::FailedPreconditionError(
                told("it is a read-only replica; name the primary (target_session_attrs)"))),
            .connected = false};
  }
  if (state == "22021") {
    return {absl::InvalidArgumentError("a name holds bytes that are no text in UTF-8")};
  }
  if (state == "40001" || state == "40P01") {
    return {.status = SameRows(name), .transient = true};
  }
  if (state == "55P03") {
    return {HidingDatabase(
        absl::UnavailableError(told("others hold the same rows for too long; try again")),
        kSameRows)};
  }
  if (state == "57014") {
    return {HidingDatabase(
        absl::UnavailableError(told("a statement took too long and was ended; try again")))};
  }
  if (absl::StartsWith(state, "08") || absl::StartsWith(state, "57P") || state == "53300" ||
      state == "25P03") {
    return LostConnection(name, error);
  }
  return {HidingDatabase(absl::InternalError(
      absl::StrCat("database ", name, ": ", FirstLine(error.what()), " (SQLSTATE ", state, ")")))};
}

}  // namespace

absl::Status HidingDatabase(absl::Status status, absl::string_view sentence) {
  const absl::StatusCode code = status.code();
  return TellingClients(std::move(status), sentence.empty() ? SentenceOf(code) : sentence);
}

PostgresFailure FailureOfCaught(const std::string& name) {
  try {
    throw;
  } catch (const pqxx::sql_error& error) {
    return FailureOf(name, error);
  } catch (const pqxx::transaction_rollback&) {
    return {.status = SameRows(name), .transient = true};
  } catch (const pqxx::broken_connection& error) {
    return LostConnection(name, error);
  } catch (const std::exception& error) {
    return {.status = HidingDatabase(absl::InternalError(
                absl::StrCat("database ", name, ": ", FirstLine(error.what())))),
            .connected = false};
  }
}

absl::Status ConnectError(const std::string& name, absl::string_view what) {
  if (absl::StrContains(what, "password authentication failed") ||
      absl::StrContains(what, "no password supplied")) {
    return HidingDatabase(absl::FailedPreconditionError(absl::StrCat(
        "database ", name,
        ": it refuses the user or the password; mend its address or the password file")));
  }
  // libpq tells of every address that it has tried; the last words of the first are the reason.
  return HidingDatabase(
      absl::UnavailableError(absl::StrCat("database ", name, ": ", FirstLine(what))));
}

}  // namespace tissueform
