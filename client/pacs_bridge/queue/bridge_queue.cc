// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/queue/bridge_queue.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/platform/storage/durable_file.h"
#include "server/platform/storage/fault_points.h"

namespace tissueform {
namespace {

// "TisB": by which file(1) and we know the database.
constexpr int64_t kQueueApplicationId = 0x54'69'73'42;
constexpr int64_t kQueueVersion = 1;

// States are the names of series_state.h and export_state.h. A series' images stay known when their
// files are gone: what is written later refers to them.
constexpr char kQueueTables[] =
    "CREATE TABLE studies (uid TEXT PRIMARY KEY, patient_id TEXT NOT NULL, issuer TEXT NOT NULL, "
    "name TEXT NOT NULL, birth_date TEXT NOT NULL, readable INTEGER NOT NULL, "
    "study_date TEXT NOT NULL, description TEXT NOT NULL) STRICT;"
    "CREATE TABLE series (key TEXT PRIMARY KEY, study_uid TEXT NOT NULL REFERENCES studies(uid), "
    "uid TEXT NOT NULL UNIQUE, frame_uid TEXT NOT NULL, modality TEXT NOT NULL, "
    "state TEXT NOT NULL, reason TEXT NOT NULL, recipe TEXT NOT NULL, case_name TEXT NOT NULL, "
    "attempts INTEGER NOT NULL, last_error TEXT NOT NULL, first_s INTEGER NOT NULL, "
    "done_s INTEGER NOT NULL, has_files INTEGER NOT NULL, has_header INTEGER NOT NULL) STRICT;"
    "CREATE INDEX series_by_study ON series(study_uid);"
    "CREATE INDEX series_by_case ON series(case_name);"
    "CREATE TABLE images (series TEXT NOT NULL REFERENCES series(key), uid TEXT NOT NULL, "
    "class_uid TEXT NOT NULL, file TEXT NOT NULL, PRIMARY KEY (series, uid)) STRICT;"
    "CREATE TABLE exports (name TEXT PRIMARY KEY, key TEXT NOT NULL UNIQUE, "
    "prediction TEXT NOT NULL, case_name TEXT NOT NULL, state TEXT NOT NULL, "
    "note TEXT NOT NULL, confirmed TEXT NOT NULL, attempts INTEGER NOT NULL, "
    "last_error TEXT NOT NULL, first_s INTEGER NOT NULL, done_s INTEGER NOT NULL) STRICT;"
    "CREATE TABLE objects (export TEXT NOT NULL REFERENCES exports(name), key TEXT NOT NULL, "
    "uid TEXT NOT NULL UNIQUE, file TEXT NOT NULL, sent INTEGER NOT NULL, "
    "PRIMARY KEY (export, key)) STRICT;";

// What came later than the first queues of this version, whose programs pass over it.
// A case has the first images of its series, by how many there were when it was packed; a draft on
// the server, too, when it was sent.
constexpr char kLaterTables[] =
    "CREATE INDEX IF NOT EXISTS series_by_state ON series(state);"
    "CREATE TABLE IF NOT EXISTS cases (name TEXT PRIMARY KEY, series TEXT NOT NULL REFERENCES "
    "series(key), images INTEGER NOT NULL) STRICT;"
    "CREATE TABLE IF NOT EXISTS drafts (name TEXT PRIMARY KEY, series TEXT NOT NULL REFERENCES "
    "series(key), images INTEGER NOT NULL) STRICT;"
    "INSERT OR IGNORE INTO cases SELECT case_name, key, (SELECT COUNT(*) FROM images WHERE "
    "images.series = series.key) FROM series WHERE case_name <> '';";

absl::StatusOr<int64_t> PragmaOf(Database& database, const char* sql) {
  Database::Query query = database.Prepare(sql);
  TF_ASSIGN_OR_RETURN(const bool row, query.Step());
  return row ? query.Integer(0) : 0;
}

absl::Status CheckVersion(Database& database, int64_t version) {
  TF_ASSIGN_OR_RETURN(const int64_t application, PragmaOf(database, "PRAGMA application_id"));
  if (version == kQueueVersion && application == kQueueApplicationId) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("queue ", database.path(), " has version ", version, ", this program supports ",
                   kQueueVersion, "; use the program that made it, or another --state-dir"));
}

}  // namespace

BridgeQueue::BridgeQueue(std::string path, std::optional<DataFolder> held,
                         std::unique_ptr<Database> database)
    : path_(std::move(path)), held_(std::move(held)), database_(std::move(database)) {}

absl::StatusOr<std::unique_ptr<BridgeQueue>> BridgeQueue::Open(const std::string& folder) {
  TF_ASSIGN_OR_RETURN(DataFolder held, DataFolder::Open(folder));
  const std::string path = held.path();
  for (const char* name : {"received", "plans", "headers", "objects"}) {
    TF_RETURN_IF_ERROR(MakeFolder(absl::StrCat(path, "/", name)));
  }
  TF_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, Database::Open(path + "/queue.db"));
  TF_RETURN_IF_ERROR(SyncFolder(path));
  std::unique_ptr<BridgeQueue> queue(new BridgeQueue(path, std::move(held), std::move(database)));
  TF_RETURN_IF_ERROR(queue->PrepareTables());
  return queue;
}

absl::StatusOr<std::unique_ptr<BridgeQueue>> BridgeQueue::OpenForReading(
    const std::string& folder) {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<Database> database,
                      Database::OpenForReading(folder + "/queue.db"));
  TF_ASSIGN_OR_RETURN(const int64_t version, PragmaOf(*database, "PRAGMA user_version"));
  TF_RETURN_IF_ERROR(CheckVersion(*database, version));
  return std::unique_ptr<BridgeQueue>(new BridgeQueue(folder, std::nullopt, std::move(database)));
}

absl::Status BridgeQueue::PrepareTables() {
  return Change([](Database& database) -> absl::Status {
    TF_ASSIGN_OR_RETURN(const int64_t version, PragmaOf(database, "PRAGMA user_version"));
    if (version != 0) {
      TF_RETURN_IF_ERROR(CheckVersion(database, version));
      return database.Execute(kLaterTables);
    }
    TF_RETURN_IF_ERROR(database.Execute(kQueueTables));
    TF_RETURN_IF_ERROR(database.Execute(kLaterTables));
    return database.Execute(absl::StrCat("PRAGMA application_id=", kQueueApplicationId,
                                         ";PRAGMA user_version=", kQueueVersion));
  });
}

absl::Status BridgeQueue::Change(absl::FunctionRef<absl::Status(Database&)> change) {
  MutexLock lock(mutex_);
  TF_RETURN_IF_ERROR(database_->Execute("BEGIN IMMEDIATE"));
  absl::Status status = change(*database_);
  TF_FAULT_POINT("queue.changed");
  if (status.ok()) status = database_->Execute("COMMIT");
  if (!status.ok() && database_->in_transaction()) database_->Execute("ROLLBACK").IgnoreError();
  return status;
}

absl::Status BridgeQueue::Read(absl::FunctionRef<absl::Status(Database&)> read) {
  MutexLock lock(mutex_);
  return read(*database_);
}

std::string NewQueueKey() { return Sha256Hex({NewDicomUid()}).substr(0, 32); }

std::string TextOf(const Database::Query& query, int column) {
  return std::string(query.Text(column));
}

}  // namespace tissueform
