// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_errors.h"

#include <algorithm>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/cord.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include <pqxx/pqxx>

#include "server/store/store_errors.h"

namespace tissueform {
namespace {

using absl::StatusCode;

std::string FirstLine(absl::string_view text) {
  const std::vector<absl::string_view> lines = absl::StrSplit(text, absl::MaxSplits('\n', 1));
  absl::string_view line = absl::StripAsciiWhitespace(lines[0]);
  for (const absl::string_view prefix : {"ERROR:", "FATAL:"}) absl::ConsumePrefix(&line, prefix);
  return std::string(absl::StripAsciiWhitespace(line));
}

constexpr char kSameRows[] = "concurrent changes; try again";

absl::Status DatabaseError(StatusCode code, const std::string& name, absl::string_view what,
                           absl::string_view sentence = "") {
  return HidingDatabase(absl::Status(code, absl::StrCat("database ", name, ": ", what)), sentence);
}

constexpr char kReadOnly[] = "it is a read-only replica; use the primary (target_session_attrs)";
constexpr char kNoChanges[] = "the server's database is read-only now; try again in a minute";

constexpr char kSameRowsUrl[] = "type.tissueform/OthersHoldRows";

absl::Status HeldByOthers(const std::string& name, absl::string_view what) {
  absl::Status status = DatabaseError(StatusCode::kUnavailable, name, what, kSameRows);
  status.SetPayload(kSameRowsUrl, absl::Cord());
  return status;
}

PostgresFailure SameRows(const std::string& name) {
  constexpr char kWhat[] = "concurrent writes to the same rows; try again";
  return {.status = HeldByOthers(name, kWhat), .transient = true};
}

PostgresFailure LostConnection(const std::string& name, const std::exception& error) {
  return {.status = DatabaseError(StatusCode::kUnavailable, name, FirstLine(error.what())),
          .transient = true,
          .connected = false};
}

// By SQLSTATE; https://www.postgresql.org/docs/15/errcodes-appendix.html
PostgresFailure FailureOf(const std::string& name, const pqxx::sql_error& error) {
  const std::string& state = error.sqlstate();
  if (state == "53100") {
    return {
        DatabaseError(StatusCode::kResourceExhausted, name, "its disk is full; free some space")};
  }
  if (state == "25006") {
    // Where a failover has made a replica of what was the primary another connection may find it.
    return {.status = DatabaseError(StatusCode::kUnavailable, name, kReadOnly, kNoChanges),
            .transient = true,
            .connected = false};
  }
  if (state == "22021") {
    return {absl::InvalidArgumentError("a name is not UTF-8")};
  }
  if (state == "40001" || state == "40P01") return SameRows(name);
  if (state == "55P03") {
    return {HeldByOthers(name, "the rows are locked for too long; try again")};
  }
  if (state == "57014") {
    return {DatabaseError(StatusCode::kUnavailable, name,
                          "a statement took too long and was canceled; try again")};
  }
  if (absl::StartsWith(state, "08") || absl::StartsWith(state, "57P") || state == "53300" ||
      state == "25P03") {
    return LostConnection(name, error);
  }
  return {DatabaseError(StatusCode::kInternal, name,
                        absl::StrCat(FirstLine(error.what()), " (SQLSTATE ", state, ")"))};
}

}  // namespace

PostgresFailure FailureOfCaught(const std::string& name) {
  try {
    throw;
  } catch (const pqxx::sql_error& error) {
    return FailureOf(name, error);
  } catch (const pqxx::transaction_rollback&) {
    return SameRows(name);
  } catch (const pqxx::broken_connection& error) {
    return LostConnection(name, error);
  } catch (const std::exception& error) {
    return {.status = DatabaseError(StatusCode::kInternal, name, FirstLine(error.what())),
            .connected = false};
  }
}

bool OthersHoldRows(const absl::Status& status) {
  return status.GetPayload(kSameRowsUrl).has_value();
}

absl::Status ConnectError(const std::string& name, absl::string_view what) {
  // Of all addresses: what another one says may pass.
  const std::vector<absl::string_view> addresses =
      absl::StrSplit(what, '\n', absl::SkipWhitespace());
  if (!addresses.empty() &&
      std::all_of(addresses.begin(), addresses.end(), [](absl::string_view address) {
        return absl::StrContains(address, "session is read-only");
      })) {
    return DatabaseError(StatusCode::kFailedPrecondition, name, kReadOnly);
  }
  if (absl::StrContains(what, "password authentication failed") ||
      absl::StrContains(what, "no password supplied")) {
    return DatabaseError(
        StatusCode::kFailedPrecondition, name,
        "it refuses the user or the password; correct its address or the password file");
  }
  // libpq reports every address that it has tried; the last words of the first are the reason.
  return DatabaseError(StatusCode::kUnavailable, name, FirstLine(what));
}

}  // namespace tissueform
