// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/backup/backup_contents.h"

#include <array>
#include <fcntl.h>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/platform/storage/database.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/store_errors.h"
#include "server/store/store_schema.h"

namespace tissueform {
namespace {

// A database of a version before has not all of them.
struct ClaimingTable {
  const char* name;
  const char* claims;
};

constexpr std::array<ClaimingTable, 3> kClaimingTables = {{
    {"meshes", "SELECT sha256 FROM meshes"},
    {"predictions", "SELECT positions_sha256 FROM predictions"},
    {"cases", "SELECT sha256 FROM cases"},
}};

absl::StatusOr<bool> HasTable(Database& database, absl::string_view name) {
  Database::Query query =
      database.Prepare("SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = ?");
  return query.Bind(name).Step();
}

absl::Status AddClaims(Database& database, const ClaimingTable& table,
                       std::set<std::string>* blobs) {
  TF_ASSIGN_OR_RETURN(const bool there, HasTable(database, table.name));
  if (!there) return absl::OkStatus();
  Database::Query query = database.Prepare(table.claims);
  for (;;) {
    TF_ASSIGN_OR_RETURN(const bool row, query.Step());
    if (!row) return absl::OkStatus();
    // It becomes the name of a file.
    if (!IsSha256Hex(query.Text(0))) {
      return Damaged(database.path(), "a row names a file whose name is not a SHA-256");
    }
    blobs->emplace(query.Text(0));
  }
}

absl::StatusOr<FileDigest> ReadAll(const std::string& path,
                                   const std::function<absl::Status(absl::string_view)>& sink) {
  std::error_code error;
  const auto status = std::filesystem::symlink_status(path, error);
  // Reading a pipe would block forever.
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    return Damaged(path, "it is not a file");
  }
  Sha256 digest;
  FileDigest found;
  TF_RETURN_IF_ERROR(ReadInPieces(path, [&](absl::string_view piece) {
    digest.Add(piece);
    found.bytes += static_cast<int64_t>(piece.size());
    return sink(piece);
  }));
  found.sha256 = digest.Hex();
  return found;
}

}  // namespace

std::string BackupDatabase(const std::string& backup) { return backup + "/tissueform.db"; }
std::string BackupSums(const std::string& backup) { return backup + "/SHA256SUMS"; }
std::string BackupBlob(const std::string& backup, const std::string& sha256) {
  return absl::StrCat(backup, "/blobs/", sha256);
}

absl::StatusOr<BackupContents> ReadBackupContents(const std::string& database) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<Database> opened, Database::OpenForReading(database));
  BackupContents contents;
  TF_ASSIGN_OR_RETURN(contents.schema_version, SchemaVersionOf(*opened));
  if (contents.schema_version == 0)
    return Damaged(database, "it has no data of a Tissueform server");
  if (const absl::Status status = QuickCheck(*opened); !status.ok()) {
    return Damaged(database, status.message());
  }
  std::set<std::string> blobs;
  for (const ClaimingTable& table : kClaimingTables) {
    TF_RETURN_IF_ERROR(AddClaims(*opened, table, &blobs));
  }
  contents.blobs.assign(blobs.begin(), blobs.end());
  return contents;
}

std::string SumsText(const std::string& database_sha256, const std::vector<std::string>& blobs) {
  std::string text = absl::StrCat(database_sha256, "  tissueform.db\n");
  for (const std::string& sha256 : blobs) absl::StrAppend(&text, sha256, "  blobs/", sha256, "\n");
  return text;
}

absl::StatusOr<FileDigest> DigestOf(const std::string& path) {
  return ReadAll(path, [](absl::string_view) { return absl::OkStatus(); });
}

absl::StatusOr<FileDigest> CopyWithDigest(const std::string& from, const std::string& to) {
  TF_ASSIGN_OR_RETURN(OpenFile copy, OpenFile::Open(to, O_WRONLY | O_CREAT | O_TRUNC));
  int64_t offset = 0;
  TF_ASSIGN_OR_RETURN(const FileDigest found, ReadAll(from, [&](absl::string_view piece) {
                        const int64_t place = offset;
                        offset += static_cast<int64_t>(piece.size());
                        return copy.WriteAt(place, piece);
                      }));
  TF_RETURN_IF_ERROR(copy.Sync());
  return found;
}

absl::Status CheckDigest(const FileDigest& found, const std::string& sha256,
                         const std::string& path) {
  if (found.sha256 == sha256) return absl::OkStatus();
  return Damaged(path, "its SHA-256 is wrong");
}

}  // namespace tissueform
