// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_case_store.h"

#include <atomic>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/postgres_store/postgres_case_rows.h"
#include "server/store/postgres_store/postgres_pages.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

absl::StatusOr<OpenFile> OpenNamelessFile() {
  static std::atomic<unsigned> counter = 0;
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  if (error) return absl::UnavailableError("there is no temporary folder; set TMPDIR");
  const std::string path =
      absl::StrCat(folder.string(), "/tissueform-case.", getpid(), ".", counter++);
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenFile::Open(path, O_RDWR | O_CREAT | O_EXCL));
  unlink(path.c_str());
  return file;
}

// As SQL puts a key into words.
std::string WordsOfKeys(const std::set<CaseKey>& keys) {
  std::set<std::string> words;
  for (const CaseKey& key : keys) words.insert(key.sha256 + absl::BytesToHexString(key.owner));
  return PostgresNames(words);
}

class PostgresCaseWriter final : public CaseWriter {
 public:
  PostgresCaseWriter(CaseRecord record, int most, PostgresPool* pool, OpenFile file)
      : CaseWriter(std::move(record)), most_(most), pool_(pool), file_(std::move(file)) {}

 protected:
  absl::Status Append(absl::string_view bytes) override {
    TF_RETURN_IF_ERROR(file_.WriteAt(bytes_, bytes));
    bytes_ += static_cast<int64_t>(bytes.size());
    return absl::OkStatus();
  }

  absl::StatusOr<CaseRecord> Keep() override {
    return AskPool<CaseRecord>(
        pool_,
        [&](PostgresTransaction& transaction) -> absl::StatusOr<CaseRecord> {
          TF_RETURN_IF_ERROR(
              PutBlob(transaction, record().sha256, bytes_,
                      [this](int64_t offset, int64_t size) { return file_.ReadAt(offset, size); }));
          return KeepCaseRow(transaction, record(), most_);
        },
        PostgresPool::Idempotent::kNo);
  }

 private:
  const int most_;
  PostgresPool* const pool_;
  OpenFile file_;
  int64_t bytes_ = 0;
};

class PostgresCaseReader final : public CaseReader {
 public:
  PostgresCaseReader(const CaseRecord& record, PostgresPool* pool, OpenFile file)
      : CaseReader(record.sha256, record.total_bytes), pool_(pool), file_(std::move(file)) {}

 protected:
  absl::StatusOr<std::string> ReadAt(int64_t offset, int64_t size) override {
    return file_.ReadAt(offset, size);
  }
  absl::Status SetAside(const absl::Status& damage) override {
    return SetPostgresBlobAside(pool_, sha256(), damage);
  }

 private:
  PostgresPool* const pool_;
  const OpenFile file_;
};

// Copies the case into the file.
absl::StatusOr<CaseRecord> CopyCase(PostgresTransaction& transaction, const CaseKey& key,
                                    OpenFile* file) {
  TF_RETURN_IF_ERROR(ReadOneMoment(transaction));
  TF_ASSIGN_OR_RETURN(CaseRecord record, FindCaseRow(transaction, key));
  int64_t bytes = 0;
  const auto write = [&](absl::string_view piece) {
    absl::Status status = file->WriteAt(bytes, piece);
    bytes += static_cast<int64_t>(piece.size());
    return status;
  };
  TF_RETURN_IF_ERROR(ReadBlob(transaction, key.sha256, record.total_bytes, write));
  return record;
}

}  // namespace

absl::StatusOr<std::unique_ptr<CaseWriter>> PostgresCaseStore::Begin(CaseRecord record, int most) {
  TF_RETURN_IF_ERROR(CheckCaseRecord(record));
  TF_RETURN_IF_ERROR(pool_->Run(
      [&](PostgresTransaction& transaction) { return CheckCaseRoom(transaction, most); }));
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenNamelessFile());
  return std::make_unique<PostgresCaseWriter>(std::move(record), most, pool_, std::move(file));
}

absl::StatusOr<CaseRecord> PostgresCaseStore::Find(const CaseKey& key) {
  return AskPool<CaseRecord>(
      pool_, [&](PostgresTransaction& transaction) { return FindCaseRow(transaction, key); });
}

absl::StatusOr<std::unique_ptr<CaseReader>> PostgresCaseStore::Open(const CaseKey& key,
                                                                    int64_t now_s) {
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenNamelessFile());
  const absl::StatusOr<CaseRecord> record = AskPool<CaseRecord>(
      pool_, [&](PostgresTransaction& transaction) { return CopyCase(transaction, key, &file); });
  if (absl::IsDataLoss(record.status())) {
    return SetPostgresBlobAside(pool_, key.sha256, record.status());
  }
  TF_RETURN_IF_ERROR(record.status());
  TF_RETURN_IF_ERROR(Touch(key, now_s));
  return std::make_unique<PostgresCaseReader>(*record, pool_, std::move(file));
}

absl::StatusOr<CaseStore::Page> PostgresCaseStore::List(const ListRequest& request) {
  if (request.limit < 1) return BadLimit(request.limit);
  const std::string also = WordsOfKeys(request.also);
  return AskPool<Page>(pool_, [&](PostgresTransaction& transaction) -> absl::StatusOr<Page> {
    TF_ASSIGN_OR_RETURN(
        const PostgresRows rows,
        transaction.Query(
            "SELECT sha256, owner, record, last_used_s FROM cases WHERE sha256 > $1 AND "
            "($2::bigint = 1 OR owner = $3 OR sha256 || encode(convert_to(owner, 'UTF8'), 'hex') = "
            "ANY (string_to_array($4, chr(31)))) ORDER BY sha256, owner LIMIT $5",
            {request.after, int64_t{!request.owner.has_value()}, request.owner.value_or(""), also,
             RowsOfPage(request.limit)}));
    return ReadPostgresPage<Page>(rows, request.limit, 0, ReadCaseColumns);
  });
}

absl::Status PostgresCaseStore::Delete(const CaseKey& key) {
  return pool_->Run(
      [&](PostgresTransaction& transaction) { return DeleteCaseRow(transaction, key); });
}

absl::Status PostgresCaseStore::Touch(const CaseKey& key, int64_t now_s) {
  return pool_->Run(
      [&](PostgresTransaction& transaction) { return TouchCaseRow(transaction, key, now_s); });
}

absl::StatusOr<std::vector<CaseKey>> PostgresCaseStore::RemoveUnused(
    int64_t before_s, const std::set<std::string>& spared, int most) {
  TF_ASSIGN_OR_RETURN(
      const PostgresRows rows, AskPool<PostgresRows>(pool_, [&](PostgresTransaction& transaction) {
        return transaction.Query(
            "SELECT sha256, owner FROM cases WHERE last_used_s < $1 AND NOT sha256 = ANY "
            "(string_to_array($2, chr(31))) ORDER BY last_used_s, sha256, owner LIMIT $3",
            {before_s, PostgresNames(spared), int64_t{most}});
      }));
  std::vector<CaseKey> removed;
  for (size_t row = 0; row < rows.size(); ++row) {
    CaseKey key{.sha256 = std::string(rows.Text(row, 0)), .owner = std::string(rows.Text(row, 1))};
    // It may have been used, or removed by another server, in the meantime.
    const absl::Status status = pool_->Run([&](PostgresTransaction& transaction) -> absl::Status {
      TF_RETURN_IF_ERROR(LockBlob(transaction, key.sha256));
      TF_ASSIGN_OR_RETURN(
          const PostgresRows still,
          transaction.Query("SELECT 1 FROM cases WHERE sha256 = $1 AND owner = $2 AND "
                            "last_used_s < $3 FOR UPDATE",
                            {key.sha256, key.owner, before_s}));
      return still.empty() ? NoCase(key.sha256) : DeleteCaseRow(transaction, key);
    });
    if (absl::IsNotFound(status)) continue;
    TF_RETURN_IF_ERROR(status);
    removed.push_back(std::move(key));
  }
  return removed;
}

}  // namespace tissueform
