// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/storage/database.h"

#include <cerrno>
#include <fcntl.h>
#include <sqlite3.h>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "server/platform/storage/client_messages.h"
#include "server/platform/storage/durable_file.h"

namespace tissueform {
namespace {

// For a moment another program may hold the database: the sqlite3 tool, a backup.
constexpr int kBusyMs = 5000;
// But the thread that commits does not wait long for the log to be emptied.
constexpr int kTruncateBusyMs = 20;

// A connection of its own locking would leave no way for a backup beside the server, so the index
// of the log is in shared memory as usual. cell_size_check finds damaged pages before they are
// used.
constexpr char kSettings[] =
    "PRAGMA journal_mode=WAL;"
    "PRAGMA synchronous=FULL;"
    "PRAGMA secure_delete=ON;"
    "PRAGMA foreign_keys=ON;"
    "PRAGMA trusted_schema=OFF;"
    "PRAGMA cell_size_check=ON;";
constexpr char kInMemory[] = ":memory:";
constexpr char kSettingsForReading[] =
    "PRAGMA trusted_schema=OFF;"
    "PRAGMA cell_size_check=ON;";

bool NoRoom(int error_number) {
  return error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG;
}

absl::Status ToStatus(sqlite3* handle, const std::string& path) {
  const std::string message = absl::StrCat("database ", path, ": ", sqlite3_errmsg(handle));
  const int error_number = sqlite3_system_errno(handle);
  switch (sqlite3_errcode(handle) & 0xFF) {
    case SQLITE_FULL:
      return WithReason(absl::ResourceExhaustedError(
                            absl::StrCat("database ", path, ": the disk is full; free some space")),
                        ErrorReason::kDiskFull);
    case SQLITE_IOERR:
      if (NoRoom(error_number)) {
        return WithReason(absl::ResourceExhaustedError(absl::StrCat(
                              "database ", path, ": the disk is full; free some space")),
                          ErrorReason::kDiskFull);
      }
      return absl::InternalError(absl::StrCat(message, "; check the disk"));
    case SQLITE_READONLY:
      return absl::FailedPreconditionError(
          absl::StrCat(message, "; make the folder and the disk writable"));
    case SQLITE_CANTOPEN:
      if (error_number == EROFS) return FileError(error_number, "cannot open", path);
      return absl::FailedPreconditionError(absl::StrCat(message, "; check its folder"));
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::DataLossError(message);
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return absl::UnavailableError(
          absl::StrCat(message, "; another program holds it: stop that program or try again"));
    default:
      return absl::InternalError(message);
  }
}

}  // namespace

Database::Query::~Query() {
  if (statement_ == nullptr) return;
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

Database::Query::Query(Query&& other) noexcept
    : database_(other.database_),
      statement_(std::exchange(other.statement_, nullptr)),
      bound_(other.bound_),
      error_(other.error_) {}

Database::Query& Database::Query::Bind(int64_t value) {
  if (error_ == SQLITE_OK) error_ = sqlite3_bind_int64(statement_, ++bound_, value);
  return *this;
}

Database::Query& Database::Query::Bind(absl::string_view text) {
  if (error_ == SQLITE_OK) {
    // A null pointer would be NULL, and an empty view may have one.
    error_ = sqlite3_bind_text(statement_, ++bound_, text.empty() ? "" : text.data(),
                               static_cast<int>(text.size()), SQLITE_STATIC);
  }
  return *this;
}

Database::Query& Database::Query::BindBytes(absl::string_view bytes) {
  if (error_ == SQLITE_OK) {
    error_ = sqlite3_bind_blob64(statement_, ++bound_, bytes.empty() ? "" : bytes.data(),
                                 bytes.size(), SQLITE_STATIC);
  }
  return *this;
}

absl::StatusOr<bool> Database::Query::Step() {
  if (statement_ == nullptr || error_ != SQLITE_OK) return database_->Error();
  const int result = sqlite3_step(statement_);
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  return database_->Error();
}

absl::Status Database::Query::Run() {
  bool row = true;
  while (row) {
    TF_ASSIGN_OR_RETURN(row, Step());
  }
  return absl::OkStatus();
}

int64_t Database::Query::Integer(int column) const {
  return sqlite3_column_int64(statement_, column);
}

absl::string_view Database::Query::Text(int column) const { return Bytes(column); }

absl::string_view Database::Query::Bytes(int column) const {
  // In this order: see sqlite.org/c3ref/column_blob.html.
  const void* bytes = sqlite3_column_blob(statement_, column);
  const int size = sqlite3_column_bytes(statement_, column);
  return bytes == nullptr
             ? absl::string_view()
             : absl::string_view(static_cast<const char*>(bytes), static_cast<size_t>(size));
}

int Database::Query::num_columns() const { return sqlite3_column_count(statement_); }

void Database::Query::CopyColumn(int column, Query* other) const {
  if (other->error_ == SQLITE_OK) {
    other->error_ = sqlite3_bind_value(other->statement_, ++other->bound_,
                                       sqlite3_column_value(statement_, column));
  }
}

absl::StatusOr<std::unique_ptr<Database>> Database::Open(const std::string& path) {
  // Made here, so that no other user may read it, regardless of the umask; SQLite gives its other
  // files the same rights.
  TF_RETURN_IF_ERROR(OpenFile::Open(path, O_RDWR | O_CREAT).status());
  return Open(path, SQLITE_OPEN_READWRITE, kSettings);
}

absl::StatusOr<std::unique_ptr<Database>> Database::OpenForReading(const std::string& path) {
  TF_RETURN_IF_ERROR(OpenFile::Open(path, O_RDONLY).status());
  return Open(path, SQLITE_OPEN_READONLY, kSettingsForReading);
}

absl::StatusOr<std::unique_ptr<Database>> Database::OpenInMemory() {
  return Open(kInMemory, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, kSettings);
}

absl::StatusOr<std::unique_ptr<Database>> Database::Open(const std::string& path, int flags,
                                                         const char* settings) {
  sqlite3* handle = nullptr;
  const int result = sqlite3_open_v2(path.c_str(), &handle, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  if (handle == nullptr) return absl::ResourceExhaustedError("no memory for a database");
  std::unique_ptr<Database> database(new Database(path, handle));
  if (result != SQLITE_OK) return database->Error();
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, kBusyMs);
  TF_RETURN_IF_ERROR(database->Execute(settings));
  return database;
}

Database::~Database() {
  for (const auto& [sql, statement] : statements_) sqlite3_finalize(statement);
  sqlite3_close_v2(handle_);
}

Database::Query Database::Prepare(const char* sql,
                                  std::string (*translate)(absl::string_view sql)) {
  sqlite3_stmt*& statement = statements_[sql];
  if (statement == nullptr) {
    const std::string text = translate == nullptr ? sql : translate(sql);
    sqlite3_prepare_v3(handle_, text.c_str(), -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  }
  Query query(this, statement);
  if (statement == nullptr) query.error_ = SQLITE_ERROR;
  return query;
}

absl::Status Database::Execute(const std::string& sql) {
  return sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK
             ? absl::OkStatus()
             : Error();
}

bool Database::in_transaction() const { return sqlite3_get_autocommit(handle_) == 0; }

int64_t Database::total_changes() const { return sqlite3_total_changes64(handle_); }

absl::StatusOr<bool> Database::TruncateLog() {
  if (path_ == kInMemory) return true;
  sqlite3_busy_timeout(handle_, kTruncateBusyMs);
  const int result =
      sqlite3_wal_checkpoint_v2(handle_, nullptr, SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
  const absl::Status status = result == SQLITE_OK ? absl::OkStatus() : Error();
  sqlite3_busy_timeout(handle_, kBusyMs);
  if ((result & 0xFF) == SQLITE_BUSY) return false;
  TF_RETURN_IF_ERROR(status);
  // SQLite shortens the log without a sync: after a power cut its old pages, and with them what was
  // deleted, could be there again.
  TF_ASSIGN_OR_RETURN(OpenFile log, OpenFile::Open(path_ + "-wal", O_RDWR));
  TF_RETURN_IF_ERROR(log.Sync());
  return true;
}

absl::Status Database::Error() const { return NamingPath(ToStatus(handle_, path_), path_); }

}  // namespace tissueform
