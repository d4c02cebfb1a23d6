// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/postgres_connection.h"

#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include <pqxx/pqxx>

namespace tissueform {
namespace {

constexpr pqxx::oid kByteaType = 17;

// What a statement or a connection has failed with.
struct PostgresFailure {
  absl::Status status;
  bool transient = false;  // as PostgresOutcome
  bool connected = true;   // whether the connection is of use still
};

std::string FirstLine(absl::string_view text) {
  const std::vector<absl::string_view> lines = absl::StrSplit(text, absl::MaxSplits('\n', 1));
  absl::string_view line = absl::StripAsciiWhitespace(lines[0]);
  for (const absl::string_view prefix : {"ERROR:", "FATAL:"}) absl::ConsumePrefix(&line, prefix);
  return std::string(absl::StripAsciiWhitespace(line));
}

// By SQLSTATE; https://www.postgresql.org/docs/15/errcodes-appendix.html
PostgresFailure FailureOf(const std::string& name, const pqxx::sql_error& error) {
  const std::string& state = error.sqlstate();
  const auto told = [&](const char* what) { return absl::StrCat("database ", name, ": ", what); };
  if (state == "53100") {
    return {absl::ResourceExhaustedError(told("its disk is full; make room there"))};
  }
  if (state == "25006") {
    // Where a failover has made a replica of what was the primary another connection may find it.
    return {.status = absl::FailedPreconditionError(
                told("it is a read-only replica; name the primary (target_session_attrs)")),
            .connected = false};
  }
  if (state == "22021") {
    return {absl::InvalidArgumentError("a name holds bytes that are no text in UTF-8")};
  }
  if (state == "40001" || state == "40P01") {
    return {.status = absl::UnavailableError(told("others write the same rows; try again")),
            .transient = true};
  }
  if (state == "55P03") {
    return {absl::UnavailableError(told("others hold the same rows for too long; try again"))};
  }
  if (state == "57014") {
    return {absl::UnavailableError(told("a statement took too long and was ended; try again"))};
  }
  if (absl::StartsWith(state, "08") || absl::StartsWith(state, "57P") || state == "53300" ||
      state == "25P03") {
    return {.status = absl::UnavailableError(told(FirstLine(error.what()).c_str())),
            .transient = true,
            .connected = false};
  }
  return {absl::InternalError(
      absl::StrCat("database ", name, ": ", FirstLine(error.what()), " (SQLSTATE ", state, ")"))};
}

PostgresFailure LostConnection(const std::string& name, const std::exception& error) {
  return {.status = absl::UnavailableError(
              absl::StrCat("database ", name, ": ", FirstLine(error.what()))),
          .transient = true,
          .connected = false};
}

// The failure of what is being caught.
PostgresFailure FailureOfCaught(const std::string& name) {
  try {
    throw;
  } catch (const pqxx::sql_error& error) {
    return FailureOf(name, error);
  } catch (const pqxx::transaction_rollback&) {
    return {.status = absl::UnavailableError(
                absl::StrCat("database ", name, ": others write the same rows; try again")),
            .transient = true};
  } catch (const pqxx::broken_connection& error) {
    return LostConnection(name, error);
  } catch (const std::exception& error) {
    return {.status =
                absl::InternalError(absl::StrCat("database ", name, ": ", FirstLine(error.what()))),
            .connected = false};
  }
}

absl::Status ConnectError(const std::string& name, absl::string_view what) {
  if (absl::StrContains(what, "password authentication failed") ||
      absl::StrContains(what, "no password supplied")) {
    return absl::FailedPreconditionError(absl::StrCat(
        "database ", name, ": it refuses the user or the password; see --store-password-file"));
  }
  // libpq tells of every address that it has tried; the last words of the first are the reason.
  return absl::UnavailableError(absl::StrCat("database ", name, ": ", FirstLine(what)));
}

pqxx::binarystring ToBinary(const PostgresValue& value) {
  if (const auto* text = std::get_if<absl::string_view>(&value)) {
    return pqxx::binarystring(text->data(), text->size());
  }
  auto number = static_cast<uint64_t>(std::get<int64_t>(value));
  std::string bytes(sizeof(number), '\0');
  for (size_t i = bytes.size(); i-- > 0; number >>= 8) bytes[i] = static_cast<char>(number & 0xff);
  return pqxx::binarystring(bytes);
}

PostgresRows ToRows(const pqxx::result& result) {
  std::vector<PostgresRows::Row> rows;
  rows.reserve(result.size());
  for (const pqxx::row& from : result) {
    PostgresRows::Row row;
    row.reserve(from.size());
    for (const pqxx::field& field : from) {
      if (field.type() == kByteaType && !field.is_null()) {
        const pqxx::binarystring bytes(field);
        row.emplace_back(bytes.get(), bytes.size());
      } else {
        row.emplace_back(field.c_str(), field.size());
      }
    }
    rows.push_back(std::move(row));
  }
  return PostgresRows(std::move(rows));
}

class LibraryTransaction final : public PostgresTransaction {
 public:
  LibraryTransaction(const std::string& name, pqxx::work* work) : name_(name), work_(work) {}

  absl::StatusOr<PostgresRows> Query(const char* sql,
                                     std::initializer_list<PostgresValue> values) override {
    std::vector<pqxx::binarystring> parameters;
    parameters.reserve(values.size());
    for (const PostgresValue& value : values) parameters.push_back(ToBinary(value));
    try {
      return ToRows(work_->exec_params(sql, pqxx::prepare::make_dynamic_params(parameters)));
    } catch (...) {
      return Fail();
    }
  }

  absl::Status Execute(const std::string& sql) override {
    try {
      work_->exec(sql);
      return absl::OkStatus();
    } catch (...) {
      return Fail();
    }
  }

  const PostgresFailure& failure() const { return failure_; }

 private:
  // REQUIRES: something is being caught.
  absl::Status Fail() {
    if (failure_.status.ok()) failure_ = FailureOfCaught(name_);
    return failure_.status;
  }

  const std::string& name_;
  pqxx::work* const work_;
  PostgresFailure failure_;
};

class NoticeReceiver final : public pqxx::notification_receiver {
 public:
  NoticeReceiver(pqxx::connection_base& connection, const std::string& channel,
                 std::vector<std::string>* notices)
      : notification_receiver(connection, channel), notices_(notices) {}

  void operator()(const std::string& payload, int) override { notices_->push_back(payload); }

 private:
  std::vector<std::string>* const notices_;
};

// libpqxx prints what nobody handles.
class QuietHandler final : public pqxx::errorhandler {
 public:
  explicit QuietHandler(pqxx::connection_base& connection) : errorhandler(connection) {}
  bool operator()(const char[]) noexcept override { return false; }
};

}  // namespace

struct PostgresConnection::Library {
  explicit Library(const PostgresTarget& target)
      : name(target.name), connection(target.connection), quiet(connection) {}

  const std::string name;
  pqxx::connection connection;
  QuietHandler quiet;
  std::vector<std::string> notices;
  std::unique_ptr<NoticeReceiver> receiver;  // before the connection's end
};

int64_t PostgresRows::Integer(size_t row, size_t column) const {
  int64_t number = 0;
  return absl::SimpleAtoi(rows_[row][column], &number) ? number : 0;
}

PostgresConnection::PostgresConnection(std::unique_ptr<Library> library)
    : library_(std::move(library)) {}
PostgresConnection::~PostgresConnection() = default;

absl::StatusOr<std::unique_ptr<PostgresConnection>> PostgresConnection::Open(
    const PostgresTarget& target) {
  try {
    return std::unique_ptr<PostgresConnection>(
        new PostgresConnection(std::make_unique<Library>(target)));
  } catch (const std::exception& error) {
    return ConnectError(target.name, error.what());
  }
}

absl::Status PostgresConnection::Transact(
    const std::function<absl::Status(PostgresTransaction&)>& work, PostgresOutcome* outcome) {
  const auto fail = [&](const PostgresFailure& failure) {
    usable_ = failure.connected;
    *outcome = failure.transient ? PostgresOutcome::kTransient : PostgresOutcome::kFailed;
    return failure.status;
  };
  try {
    pqxx::work begun(library_->connection);
    LibraryTransaction transaction(library_->name, &begun);
    const absl::Status status = work(transaction);
    if (!transaction.failure().status.ok()) return fail(transaction.failure());
    *outcome = PostgresOutcome::kFailed;
    if (!status.ok()) return status;
    begun.commit();
    *outcome = PostgresOutcome::kCommitted;
    return absl::OkStatus();
  } catch (const pqxx::in_doubt_error&) {
    usable_ = false;
    *outcome = PostgresOutcome::kUnknown;
    return absl::UnavailableError(absl::StrCat(
        "database ", library_->name,
        ": the connection was lost during a commit, which may have been kept; look before you try "
        "again"));
  } catch (...) {
    return fail(FailureOfCaught(library_->name));
  }
}

absl::Status PostgresConnection::Listen(const std::string& channel) {
  try {
    library_->receiver =
        std::make_unique<NoticeReceiver>(library_->connection, channel, &library_->notices);
    return absl::OkStatus();
  } catch (...) {
    usable_ = false;
    return FailureOfCaught(library_->name).status;
  }
}

absl::StatusOr<std::vector<std::string>> PostgresConnection::WaitForNotices(
    std::chrono::milliseconds most) {
  try {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(most);
    library_->connection.await_notification(seconds.count(),
                                            std::chrono::microseconds(most - seconds).count());
    return std::exchange(library_->notices, {});
  } catch (...) {
    usable_ = false;
    return FailureOfCaught(library_->name).status;
  }
}

}  // namespace tissueform
