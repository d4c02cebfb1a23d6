// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_case_store.h"

#include <limits>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/store/access_queries.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

// Number for TakeTurns: cases are counted and added by one transaction at a time.
constexpr int64_t kCountAlone = 6073473466130133613;

absl::StatusOr<CaseRecord> FindRow(SqlTransaction& transaction, const CaseKey& key) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows,
                      transaction.Query(TF_SELECT_CASES "WHERE sha256 = $1 AND owner = $2",
                                        {key.sha256, key.owner}));
  if (rows.empty()) return NoCase(key.sha256);
  return ReadCase(rows, 0);
}

absl::Status TouchRow(SqlTransaction& transaction, const CaseKey& key, int64_t now_s) {
  return transaction.Run(
      "UPDATE cases SET last_used_s = $1 WHERE last_used_s < $1 AND sha256 = $2 AND owner = $3",
      {now_s, key.sha256, key.owner});
}

absl::Status CheckRoom(SqlTransaction& transaction, int most) {
  TF_ASSIGN_OR_RETURN(const SqlRows rows, transaction.Query("SELECT count(*) FROM cases", {}));
  return rows.Integer(0, 0) < most ? absl::OkStatus() : TooManyCases(most);
}

// Returns the stored row. Of an existing row only last_used_s changes (it rises).
absl::StatusOr<CaseRecord> KeepRow(SqlTransaction& transaction, const CaseRecord& record,
                                   int most) {
  TF_RETURN_IF_ERROR(transaction.TakeTurns(kCountAlone));
  const absl::StatusOr<CaseRecord> found = FindRow(transaction, record.key());
  if (found.ok()) {
    TF_RETURN_IF_ERROR(TouchRow(transaction, record.key(), record.last_used_s));
    return FindRow(transaction, record.key());
  }
  if (!absl::IsNotFound(found.status()) && !absl::IsDataLoss(found.status())) return found;
  TF_RETURN_IF_ERROR(CheckRoom(transaction, most));
  const std::string bytes = Seal(SerializeCaseRecord(record));
  // Replaces an unreadable row.
  TF_RETURN_IF_ERROR(transaction.Run(
      "INSERT INTO cases (sha256, owner, record, last_used_s, project, bytes) VALUES ($1, $2, $3, "
      "$4, "
      "$5, $6) ON CONFLICT (sha256, owner) DO UPDATE SET record = excluded.record, last_used_s = "
      "excluded.last_used_s, project = excluded.project, bytes = excluded.bytes",
      {record.sha256, record.owner, SqlBytes{bytes}, record.last_used_s, record.project,
       record.total_bytes}));
  return record;
}

// In the form that the statement of List builds from its columns.
std::string NamesOf(const std::set<CaseKey>& keys) {
  std::set<std::string> names;
  for (const CaseKey& key : keys) names.insert(key.sha256 + absl::BytesToHexString(key.owner));
  return SqlNames(names);
}

class SqlCaseWriter final : public CaseWriter {
 public:
  SqlCaseWriter(CaseRecord record, int most, std::unique_ptr<SqlBlobs::Incoming> blob)
      : CaseWriter(std::move(record)), most_(most), blob_(std::move(blob)) {}

 protected:
  absl::Status Append(absl::string_view bytes) override { return blob_->Append(bytes); }

  absl::StatusOr<CaseRecord> Keep() override {
    CaseRecord kept;
    TF_RETURN_IF_ERROR(
        blob_->Keep(record().sha256, [&](SqlTransaction& transaction) -> absl::Status {
          TF_ASSIGN_OR_RETURN(kept, KeepRow(transaction, record(), most_));
          return absl::OkStatus();
        }));
    return kept;
  }

 private:
  const int most_;
  const std::unique_ptr<SqlBlobs::Incoming> blob_;
};

class SqlCaseReader final : public CaseReader {
 public:
  SqlCaseReader(const CaseRecord& record, SqlBlobs* blobs, OpenFile file)
      : CaseReader(record.sha256, record.total_bytes), blobs_(blobs), file_(std::move(file)) {}

 protected:
  absl::StatusOr<std::string> ReadAt(int64_t offset, int64_t size) override {
    return file_.ReadAt(offset, size);
  }
  absl::Status SetAside(const absl::Status& damage) override {
    return blobs_->SetAside(sha256(), damage);
  }

 private:
  SqlBlobs* const blobs_;
  const OpenFile file_;
};

}  // namespace

BlobClaim ClaimOf(const CaseRecord& record) {
  return {.sha256 = record.sha256,
          .bytes = record.total_bytes,
          .what = absl::StrCat("case ", record.sha256)};
}

absl::StatusOr<std::unique_ptr<CaseWriter>> SqlCaseStore::Begin(CaseRecord record, int most) {
  TF_RETURN_IF_ERROR(CheckCaseRecord(record));
  TF_RETURN_IF_ERROR(database_->Run(
      {.work = [&](SqlTransaction& transaction) { return CheckRoom(transaction, most); },
       .reads = true,
       .repeatable = true}));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<SqlBlobs::Incoming> blob, blobs_->Receive());
  return std::make_unique<SqlCaseWriter>(std::move(record), most, std::move(blob));
}

absl::StatusOr<CaseRecord> SqlCaseStore::Find(const CaseKey& key) {
  return ReadSql<CaseRecord>(
      database_, [&](SqlTransaction& transaction) { return FindRow(transaction, key); });
}

absl::StatusOr<std::unique_ptr<CaseReader>> SqlCaseStore::Open(const CaseKey& key, int64_t now_s) {
  CaseRecord record;
  TF_ASSIGN_OR_RETURN(OpenFile file,
                      blobs_->Open([&](SqlTransaction& transaction) -> absl::StatusOr<BlobClaim> {
                        TF_ASSIGN_OR_RETURN(record, FindRow(transaction, key));
                        return ClaimOf(record);
                      }));
  TF_RETURN_IF_ERROR(Touch(key, now_s));
  return std::make_unique<SqlCaseReader>(record, blobs_, std::move(file));
}

absl::StatusOr<CaseStore::Page> SqlCaseStore::List(const ListRequest& request) {
  if (request.limit < 1) return BadLimit(request.limit);
  const std::string also = NamesOf(request.also);
  return ReadSql<Page>(database_, [&](SqlTransaction& transaction) -> absl::StatusOr<Page> {
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query(
            TF_SELECT_CASES
            "WHERE sha256 > $1 AND ($2::bigint = 1 OR owner = $3 OR sha256 || "
            "encode(convert_to(owner, 'UTF8'), 'hex') = ANY (string_to_array($4, chr(31)))) ORDER "
            "BY sha256, owner LIMIT $5",
            {request.after, int64_t{!request.owner.has_value()}, request.owner.value_or(""), also,
             RowsOfPage(request.limit)}));
    return ReadPage<Page>(rows, request.limit, 0, ReadCase);
  });
}

absl::Status SqlCaseStore::Delete(const CaseKey& key) {
  return DeleteUnused(key, std::numeric_limits<int64_t>::max());
}

absl::Status SqlCaseStore::DeleteUnused(const CaseKey& key, int64_t before_s) {
  using Names = std::vector<std::string>;
  return blobs_->Remove([&](SqlTransaction& transaction) -> absl::StatusOr<Names> {
    TF_RETURN_IF_ERROR(blobs_->Lock(transaction, key.sha256));
    TF_ASSIGN_OR_RETURN(
        const SqlRows rows,
        transaction.Query("DELETE FROM cases WHERE sha256 = $1 AND owner = $2 AND last_used_s < $3 "
                          "RETURNING key",
                          {key.sha256, key.owner, before_s}));
    if (rows.empty()) return NoCase(key.sha256);
    TF_RETURN_IF_ERROR(EraseAccessToCase(transaction, key));
    return Names{key.sha256};
  });
}

absl::Status SqlCaseStore::Touch(const CaseKey& key, int64_t now_s) {
  return database_->Run(
      {.work = [&](SqlTransaction& transaction) { return TouchRow(transaction, key, now_s); },
       .repeatable = true});
}

absl::StatusOr<std::vector<CaseKey>> SqlCaseStore::RemoveUnused(int64_t before_s,
                                                                const std::set<std::string>& spared,
                                                                int most) {
  const std::string names = SqlNames(spared);
  TF_ASSIGN_OR_RETURN(
      const SqlRows rows, ReadSql<SqlRows>(database_, [&](SqlTransaction& transaction) {
        return transaction.Query(
            "SELECT sha256, owner FROM cases WHERE last_used_s < $1 AND NOT sha256 = ANY "
            "(string_to_array($2, chr(31))) ORDER BY last_used_s, sha256, owner LIMIT $3",
            {before_s, names, int64_t{most}});
      }));
  std::vector<CaseKey> removed;
  for (size_t row = 0; row < rows.size(); ++row) {
    CaseKey key{.sha256 = std::string(rows.Text(row, 0)), .owner = std::string(rows.Text(row, 1))};
    // It may have been used, or removed by another server, since the query.
    const absl::Status status = DeleteUnused(key, before_s);
    if (absl::IsNotFound(status)) continue;
    TF_RETURN_IF_ERROR(status);
    removed.push_back(std::move(key));
  }
  return removed;
}

}  // namespace tissueform
