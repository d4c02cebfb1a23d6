// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/audit_buffer.h"

#include <cstddef>
#include <fcntl.h>
#include <filesystem>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"

namespace tissueform {
namespace {

constexpr char kTable[] =
    "PRAGMA locking_mode=EXCLUSIVE;"
    "BEGIN IMMEDIATE;"
    "CREATE TABLE IF NOT EXISTS message("
    "number INTEGER PRIMARY KEY AUTOINCREMENT, time_ms INTEGER NOT NULL, text TEXT NOT NULL);"
    "COMMIT";

}  // namespace

absl::StatusOr<std::unique_ptr<AuditBuffer>> AuditBuffer::Open(const std::string& path,
                                                               int64_t max_bytes) {
  // SQLite's own files get the permissions of this one.
  TF_RETURN_IF_ERROR(OpenFile::Open(path, O_RDWR | O_CREAT | O_NOFOLLOW).status());
  TF_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, Database::Open(path));
  TF_RETURN_IF_ERROR(SyncFolder(std::filesystem::path(path).parent_path().string()));
  TF_RETURN_IF_ERROR(database->Execute(kTable));
  std::unique_ptr<AuditBuffer> buffer(new AuditBuffer(std::move(database), max_bytes));
  MutexLock lock(buffer->mutex_);
  TF_ASSIGN_OR_RETURN(buffer->bytes_, buffer->BytesUpTo(std::numeric_limits<int64_t>::max()));
  return buffer;
}

absl::StatusOr<int64_t> AuditBuffer::BytesUpTo(int64_t number) {
  Database::Query sum =
      database_->Prepare("SELECT TOTAL(LENGTH(text)) FROM message WHERE number <= ?");
  TF_RETURN_IF_ERROR(sum.Bind(number).Step().status());
  return sum.Integer(0);
}

absl::Status AuditBuffer::Append(std::deque<std::string>* messages) {
  MutexLock lock(mutex_);
  size_t count = 0;
  int64_t bytes = 0;
  for (const std::string& message : *messages) {
    if (bytes_ + bytes + static_cast<int64_t>(message.size()) > max_bytes_) break;
    bytes += static_cast<int64_t>(message.size());
    ++count;
  }
  if (count > 0) TF_RETURN_IF_ERROR(Insert(*messages, count));
  bytes_ += bytes;
  messages->erase(messages->begin(), messages->begin() + static_cast<std::ptrdiff_t>(count));
  if (messages->empty()) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("audit buffer ", database_->path(),
                   ": full; start the collector or raise --audit-buffer-mib"));
}

absl::Status AuditBuffer::Insert(const std::deque<std::string>& messages, size_t count) {
  const int64_t time_ms = absl::ToUnixMillis(absl::Now());
  TF_RETURN_IF_ERROR(database_->Execute("BEGIN IMMEDIATE"));
  absl::Status status;
  for (size_t i = 0; i < count && status.ok(); ++i) {
    status = database_->Prepare("INSERT INTO message(time_ms, text) VALUES(?, ?)")
                 .Bind(time_ms)
                 .Bind(messages[i])
                 .Run();
  }
  if (status.ok()) status = database_->Execute("COMMIT");
  if (!status.ok() && database_->in_transaction()) database_->Execute("ROLLBACK").IgnoreError();
  return status;
}

absl::StatusOr<std::vector<AuditBuffer::Message>> AuditBuffer::Read(int64_t after, int count) {
  MutexLock lock(mutex_);
  Database::Query query = database_->Prepare(
      "SELECT number, time_ms, text FROM message WHERE number > ? ORDER BY number LIMIT ?");
  query.Bind(after).Bind(int64_t{count});
  std::vector<Message> messages;
  while (true) {
    TF_ASSIGN_OR_RETURN(const bool has_row, query.Step());
    if (!has_row) return messages;
    messages.push_back({.number = query.Integer(0),
                        .time = absl::FromUnixMillis(query.Integer(1)),
                        .text = std::string(query.Text(2))});
  }
}

absl::Status AuditBuffer::Remove(int64_t number) {
  MutexLock lock(mutex_);
  TF_ASSIGN_OR_RETURN(const int64_t bytes, BytesUpTo(number));
  TF_RETURN_IF_ERROR(
      database_->Prepare("DELETE FROM message WHERE number <= ?").Bind(number).Run());
  bytes_ -= bytes;
  return bytes_ == 0 ? database_->TruncateLog().status() : absl::OkStatus();
}

double AuditBuffer::Use() const {
  return static_cast<double>(bytes_) / static_cast<double>(max_bytes_);
}

}  // namespace tissueform
