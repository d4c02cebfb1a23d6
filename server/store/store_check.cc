// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/store_check.h"

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/session_record.h"
#include "server/store/sql_case_store.h"
#include "server/store/sql_mesh_store.h"
#include "server/store/sql_prediction_store.h"
#include "server/store/sqlite_blobs.h"
#include "server/store/store_rows.h"
#include "server/store/store_schema.h"

namespace tissueform {
namespace {

// With the key first; includes sessions without a state row.
constexpr char kSessions[] =
    "SELECT sessions.key, id, owner, record, etag, epoch, handles, poses, created_s, last_used_s "
    "FROM sessions LEFT JOIN session_states ON session_states.key = sessions.key";
constexpr char kMeshes[] = "SELECT key, sha256, record, last_used_s FROM meshes";
constexpr char kPredictions[] =
    "SELECT key, id, owner, session, positions_sha256, record, case_sha256 FROM predictions";
constexpr char kCases[] = "SELECT key, sha256, owner, record, last_used_s FROM cases";

SessionRow ToSessionRow(const Database::Query& row) {
  return {.id = row.Text(1),
          .owner = row.Text(2),
          .record = row.Bytes(3),
          .etag = row.Text(4),
          .epoch = row.Integer(5),
          .handles = row.Integer(6),
          .poses = row.Bytes(7),
          .created_s = row.Integer(8),
          .last_used_s = row.Integer(9)};
}

absl::StatusOr<PredictionRow> ToPrediction(const Database::Query& row) {
  return PredictionOf({.id = row.Text(1),
                       .owner = row.Text(2),
                       .session = row.Text(3),
                       .positions_sha256 = row.Text(4),
                       .record = row.Bytes(5),
                       .case_sha256 = row.Text(6)});
}

absl::StatusOr<CaseRecord> ToCase(const Database::Query& row) {
  return CaseOf({.sha256 = row.Text(1),
                 .owner = row.Text(2),
                 .record = row.Bytes(3),
                 .last_used_s = row.Integer(4)});
}

absl::Status CheckSize(const BlobStore& blobs, const BlobClaim& claim) {
  return CheckBlobSize(blobs, claim.sha256, claim.bytes);
}

// A row that cannot be used: what its file in the folder `damaged` is called and holds.
struct BadRow {
  int64_t key = 0;
  std::string name;
  std::string why;
  std::string bytes;
};

// Rows that `read` refuses. Collected first: a table is not changed while it is read.
absl::StatusOr<std::vector<BadRow>> BadRows(
    Database& database, const char* select, int name_column, int bytes_column,
    const std::function<absl::Status(const Database::Query&)>& read) {
  std::vector<BadRow> bad;
  Database::Query query = database.Prepare(select);
  for (;;) {
    TF_ASSIGN_OR_RETURN(const bool row, query.Step());
    if (!row) return bad;
    const absl::Status status = read(query);
    if (status.ok()) continue;
    bad.push_back({query.Integer(0), std::string(query.Text(name_column)),
                   std::string(status.message()), std::string(query.Bytes(bytes_column))});
  }
}

// Keeps the bytes of each row in a file, then changes the row by `change` (with its key).
absl::Status SetRowsAside(Database& database, const DataFolder& folder, const char* what,
                          const std::vector<BadRow>& rows, const char* change,
                          std::vector<DamagedItem>* damaged) {
  for (const BadRow& row : rows) {
    TF_RETURN_IF_ERROR(MakeFolder(folder.damaged()));
    // Ids come from clients: a key is a safe name for a file.
    const std::string file = absl::StrCat(folder.damaged(), "/", what, "-", row.key, ".record");
    TF_RETURN_IF_ERROR(WriteDurably(file, {row.bytes}));
    TF_RETURN_IF_ERROR(database.Prepare(change).Bind(row.key).Run());
    damaged->push_back({absl::StrCat(what, " \"", row.name, "\""), row.why, file});
  }
  return absl::OkStatus();
}

absl::Status CheckSessions(Database& database, const DataFolder& folder,
                           std::vector<DamagedItem>* damaged) {
  TF_ASSIGN_OR_RETURN(const std::vector<BadRow> sessions,
                      BadRows(database, kSessions, 1, 3, [](const Database::Query& row) {
                        return SessionAtRestOf(ToSessionRow(row)).status();
                      }));
  TF_RETURN_IF_ERROR(SetRowsAside(database, folder, "session", sessions,
                                  "DELETE FROM sessions WHERE key = ?", damaged));
  // A session whose poses alone are damaged goes on from rest.
  TF_ASSIGN_OR_RETURN(const std::vector<BadRow> poses,
                      BadRows(database, kSessions, 1, 7, [](const Database::Query& row) {
                        return SessionOf(ToSessionRow(row)).status();
                      }));
  for (const BadRow& row : poses) {
    const std::string rest = Seal(SerializePoses({}));
    TF_RETURN_IF_ERROR(database.Prepare("UPDATE session_states SET poses = ? WHERE key = ?")
                           .BindBytes(rest)
                           .Bind(row.key)
                           .Run());
  }
  return SetRowsAside(database, folder, "poses", poses, "SELECT ?", damaged);
}

// The bytes of `sha256`, or their size alone when the budget is used up.
absl::Status CheckBlob(BlobStore& blobs, const std::string& sha256, const absl::Status& size,
                       int64_t* budget_bytes) {
  TF_RETURN_IF_ERROR(size);
  TF_ASSIGN_OR_RETURN(const int64_t bytes, blobs.Size(sha256));
  if (bytes > *budget_bytes) return absl::OkStatus();
  *budget_bytes -= bytes;
  return blobs.Read(sha256, [](absl::string_view) { return absl::OkStatus(); });
}

// Whether the blob that a row claims has its size, by the blob's name.
using Claims = std::map<std::string, absl::Status>;

absl::Status CheckMeshes(Database& database, const BlobStore& blobs, const DataFolder& folder,
                         Claims* claims, std::vector<DamagedItem>* damaged) {
  TF_ASSIGN_OR_RETURN(const std::vector<BadRow> rows,
                      BadRows(database, kMeshes, 1, 2, [&](const Database::Query& row) {
                        const absl::StatusOr<MeshRecord> record =
                            MeshOf(row.Text(1), row.Bytes(2), row.Integer(3));
                        if (record.ok()) {
                          (*claims)[record->sha256] = CheckSize(blobs, ClaimOf(*record));
                        }
                        return record.status();
                      }));
  return SetRowsAside(database, folder, "mesh", rows, "DELETE FROM meshes WHERE key = ?", damaged);
}

absl::Status CheckPredictions(Database& database, const BlobStore& blobs, const DataFolder& folder,
                              Claims* claims, std::vector<DamagedItem>* damaged) {
  TF_ASSIGN_OR_RETURN(const std::vector<BadRow> rows,
                      BadRows(database, kPredictions, 1, 5, [&](const Database::Query& row) {
                        const absl::StatusOr<PredictionRow> prediction = ToPrediction(row);
                        if (prediction.ok()) {
                          (*claims)[prediction->positions_sha256] =
                              CheckSize(blobs, ClaimOf(*prediction));
                        }
                        return prediction.status();
                      }));
  return SetRowsAside(database, folder, "prediction", rows, "DELETE FROM predictions WHERE key = ?",
                      damaged);
}

absl::Status CheckCases(Database& database, const BlobStore& blobs, const DataFolder& folder,
                        Claims* claims, std::vector<DamagedItem>* damaged) {
  TF_ASSIGN_OR_RETURN(const std::vector<BadRow> rows,
                      BadRows(database, kCases, 1, 3, [&](const Database::Query& row) {
                        const absl::StatusOr<CaseRecord> record = ToCase(row);
                        if (record.ok()) {
                          (*claims)[record->sha256] = CheckSize(blobs, ClaimOf(*record));
                        }
                        return record.status();
                      }));
  return SetRowsAside(database, folder, "case", rows, "DELETE FROM cases WHERE key = ?", damaged);
}

// The rows that claim a damaged blob are of no use without it.
absl::Status SetClaimsAside(Database& database, const DataFolder& folder, const std::string& sha256,
                            const absl::Status& why, std::vector<DamagedItem>* damaged) {
  const auto claims = [&](int column) {
    return [&sha256, &why, column](const Database::Query& row) {
      return row.Text(column) == sha256 ? why : absl::OkStatus();
    };
  };
  TF_ASSIGN_OR_RETURN(const std::vector<BadRow> meshes,
                      BadRows(database, kMeshes, 1, 2, claims(1)));
  TF_RETURN_IF_ERROR(
      SetRowsAside(database, folder, "mesh", meshes, "DELETE FROM meshes WHERE key = ?", damaged));
  TF_ASSIGN_OR_RETURN(const std::vector<BadRow> cases, BadRows(database, kCases, 1, 3, claims(1)));
  TF_RETURN_IF_ERROR(
      SetRowsAside(database, folder, "case", cases, "DELETE FROM cases WHERE key = ?", damaged));
  TF_ASSIGN_OR_RETURN(const std::vector<BadRow> predictions,
                      BadRows(database, kPredictions, 1, 5, claims(4)));
  return SetRowsAside(database, folder, "prediction", predictions,
                      "DELETE FROM predictions WHERE key = ?", damaged);
}

absl::Status CheckBlobs(Database& database, BlobStore& blobs, const DataFolder& folder,
                        Claims claims, int64_t budget_bytes, std::vector<DamagedItem>* damaged) {
  TF_ASSIGN_OR_RETURN(const std::vector<std::string> names, blobs.List());
  // The newest first, as long as the budget lasts; then those that are claimed and not there.
  for (const std::string& sha256 : names) {
    const auto claim = claims.find(sha256);
    if (claim != claims.end()) {
      claim->second = CheckBlob(blobs, sha256, claim->second, &budget_bytes);
    }
  }
  for (const auto& [sha256, status] : claims) {
    if (status.ok()) continue;
    TF_RETURN_IF_ERROR(SetClaimsAside(database, folder, sha256, status, damaged));
    TF_ASSIGN_OR_RETURN(const std::string path, blobs.SetAside(sha256));
    if (!path.empty()) {
      damaged->push_back({absl::StrCat("file ", sha256), std::string(status.message()), path});
    }
  }
  return absl::OkStatus();
}

absl::Status RemoveLeftovers(OpenedDatabase& opened, BlobStore& blobs,
                             std::vector<DamagedItem>* damaged) {
  TF_ASSIGN_OR_RETURN(const std::vector<std::string> names, blobs.List());
  for (const std::string& sha256 : names) {
    TF_ASSIGN_OR_RETURN(const bool claimed, IsClaimed(*opened.database, sha256));
    if (claimed) continue;
    if (!opened.rows_may_be_missing) {
      TF_RETURN_IF_ERROR(blobs.Remove(sha256));
      continue;
    }
    TF_ASSIGN_OR_RETURN(const std::string path, blobs.SetAside(sha256));
    damaged->push_back({absl::StrCat("file ", sha256), "no record of it remains", path});
  }
  return absl::OkStatus();
}

// Puts the readable rows of a damaged database in its place. The old file stays, by a second name,
// until the new one has taken its name at once: no moment is without a database.
absl::Status Mend(const DataFolder& folder, std::unique_ptr<Database> old, int64_t now_s,
                  const absl::Status& why, std::vector<DamagedItem>* damaged) {
  const std::string fresh_path = folder.database() + ".mended";
  // The log belongs to the file, and would be taken for that of the new one.
  TF_ASSIGN_OR_RETURN(const bool truncated, old->TruncateLog());
  if (!truncated) return absl::UnavailableError("another program reads the database; end it");
  for (const char* suffix : {"", "-wal", "-shm"}) unlink((fresh_path + suffix).c_str());
  {
    TF_ASSIGN_OR_RETURN(const std::unique_ptr<Database> fresh, Database::Open(fresh_path));
    TF_RETURN_IF_ERROR(PrepareSchema(*fresh, now_s));
    TF_RETURN_IF_ERROR(CopyReadableRows(*old, *fresh));
    TF_RETURN_IF_ERROR(fresh->TruncateLog().status());
  }
  old.reset();
  TF_RETURN_IF_ERROR(MakeFolder(folder.damaged()));
  const std::string kept = absl::StrCat(folder.damaged(), "/tissueform-", now_s, ".db");
  unlink(kept.c_str());
  if (link(folder.database().c_str(), kept.c_str()) != 0) {
    return FileError(errno, "cannot set aside", folder.database());
  }
  TF_RETURN_IF_ERROR(SyncFolder(folder.damaged()));
  for (const char* suffix : {"-wal", "-shm"}) unlink((folder.database() + suffix).c_str());
  if (rename(fresh_path.c_str(), folder.database().c_str()) != 0) {
    return FileError(errno, "cannot rename", fresh_path);
  }
  TF_RETURN_IF_ERROR(SyncFolder(folder.path()));
  damaged->push_back({"the database", std::string(why.message()), kept});
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<OpenedDatabase> OpenCheckedDatabase(const DataFolder& folder, int64_t now_s,
                                                   std::vector<DamagedItem>* damaged) {
  std::error_code ignored;
  OpenedDatabase opened;
  opened.rows_may_be_missing = !std::filesystem::exists(folder.database(), ignored);
  const auto open = [&]() -> absl::Status {
    TF_ASSIGN_OR_RETURN(opened.database, Database::Open(folder.database()));
    TF_RETURN_IF_ERROR(PrepareSchema(*opened.database, now_s));
    return QuickCheck(*opened.database);
  };
  absl::Status status = open();
  if (absl::IsDataLoss(status) && opened.database != nullptr) {
    opened.rows_may_be_missing = true;
    if (Mend(folder, std::move(opened.database), now_s, status, damaged).ok()) status = open();
  }
  if (absl::IsDataLoss(status)) {
    return absl::DataLossError(
        absl::StrCat(status.message(), "; it cannot be repaired: restore a backup over ",
                     folder.database(), ", or move it to start with an empty store"));
  }
  TF_RETURN_IF_ERROR(status);
  return opened;
}

absl::Status CheckRowsAndBlobs(OpenedDatabase& opened, BlobStore& blobs, const DataFolder& folder,
                               int64_t max_checked_bytes, std::vector<DamagedItem>* damaged) {
  Database& database = *opened.database;
  Claims claims;
  TF_RETURN_IF_ERROR(CheckSessions(database, folder, damaged));
  TF_RETURN_IF_ERROR(CheckMeshes(database, blobs, folder, &claims, damaged));
  TF_RETURN_IF_ERROR(CheckPredictions(database, blobs, folder, &claims, damaged));
  TF_RETURN_IF_ERROR(CheckCases(database, blobs, folder, &claims, damaged));
  TF_RETURN_IF_ERROR(
      CheckBlobs(database, blobs, folder, std::move(claims), max_checked_bytes, damaged));
  return RemoveLeftovers(opened, blobs, damaged);
}

}  // namespace tissueform
