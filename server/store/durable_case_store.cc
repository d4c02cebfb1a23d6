// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/durable_case_store.h"

#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/store/claimed_blobs.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"
#include "server/store/store_rows.h"

namespace tissueform {
namespace {

absl::StatusOr<CaseRecord> FindCase(Database& database, const CaseKey& key) {
  Database::Query query = database.Prepare(TF_SELECT_CASES "WHERE sha256 = ? AND owner = ?");
  TF_ASSIGN_OR_RETURN(const bool found, query.Bind(key.sha256).Bind(key.owner).Step());
  if (!found) return NoCase(key.sha256);
  return ReadCaseRow(query);
}

absl::Status TouchCase(Database& database, const CaseKey& key, int64_t now_s) {
  return database
      .Prepare("UPDATE cases SET last_used_s = max(last_used_s, ?) WHERE sha256 = ? AND owner = ?")
      .Bind(now_s)
      .Bind(key.sha256)
      .Bind(key.owner)
      .Run();
}

absl::Status CheckRoom(Database& database, int most) {
  Database::Query query = database.Prepare("SELECT count(*) FROM cases");
  TF_RETURN_IF_ERROR(query.Step().status());
  return query.Integer(0) < most ? absl::OkStatus() : TooManyCases(most);
}

absl::Status DeleteCaseRow(Database& database, const CaseKey& key) {
  const int64_t before = database.total_changes();
  TF_RETURN_IF_ERROR(database.Prepare("DELETE FROM cases WHERE sha256 = ? AND owner = ?")
                         .Bind(key.sha256)
                         .Bind(key.owner)
                         .Run());
  return database.total_changes() > before ? absl::OkStatus() : NoCase(key.sha256);
}

// The row as it is then: of one that was there only last_used_s rises.
absl::StatusOr<CaseRecord> KeepCaseRow(Database& database, const CaseRecord& record, int most) {
  if (FindCase(database, record.key()).ok()) {
    TF_RETURN_IF_ERROR(TouchCase(database, record.key(), record.last_used_s));
    return FindCase(database, record.key());
  }
  TF_RETURN_IF_ERROR(CheckRoom(database, most));
  const std::string bytes = Seal(SerializeCaseRecord(record));
  // In place of a row that cannot be read.
  TF_RETURN_IF_ERROR(database
                         .Prepare("INSERT OR REPLACE INTO cases (sha256, owner, record, "
                                  "last_used_s) VALUES (?, ?, ?, ?)")
                         .Bind(record.sha256)
                         .Bind(record.owner)
                         .BindBytes(bytes)
                         .Bind(record.last_used_s)
                         .Run());
  return record;
}

// As SQL puts a key into words.
std::string KeysOf(const std::set<CaseKey>& keys) {
  std::set<std::string> words;
  for (const CaseKey& key : keys) {
    words.insert(key.sha256 + absl::AsciiStrToUpper(absl::BytesToHexString(key.owner)));
  }
  return NamesInJson(words);
}

class DurableCaseWriter final : public CaseWriter {
 public:
  DurableCaseWriter(CaseRecord record, int most, CommitThread* thread, BlobStore* blobs,
                    std::unique_ptr<BlobStore::Incoming> file)
      : CaseWriter(std::move(record)),
        most_(most),
        thread_(thread),
        blobs_(blobs),
        file_(std::move(file)) {}

 protected:
  absl::Status Append(absl::string_view bytes) override { return file_->Append(bytes); }

  absl::StatusOr<CaseRecord> Keep() override {
    const std::string& sha256 = record().sha256;
    CaseRecord kept;
    const auto keep_row = [&](Database& database) -> absl::Status {
      TF_ASSIGN_OR_RETURN(kept, KeepCaseRow(database, record(), most_));
      return absl::OkStatus();
    };
    TF_RETURN_IF_ERROR(Claim(thread_, blobs_, sha256, file_->Keep(sha256), keep_row));
    return kept;
  }

 private:
  const int most_;
  CommitThread* const thread_;
  BlobStore* const blobs_;
  const std::unique_ptr<BlobStore::Incoming> file_;
};

class DurableCaseReader final : public CaseReader {
 public:
  DurableCaseReader(const CaseRecord& record, CommitThread* thread, BlobStore* blobs, OpenFile file)
      : CaseReader(record.sha256, record.total_bytes),
        thread_(thread),
        blobs_(blobs),
        file_(std::move(file)) {}

 protected:
  absl::StatusOr<std::string> ReadAt(int64_t offset, int64_t size) override {
    return file_.ReadAt(offset, size);
  }
  absl::Status SetAside(const absl::Status& damage) override {
    return SetBlobAside(thread_, blobs_, sha256(), damage);
  }

 private:
  CommitThread* const thread_;
  BlobStore* const blobs_;
  const OpenFile file_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CaseWriter>> DurableCaseStore::Begin(CaseRecord record, int most) {
  TF_RETURN_IF_ERROR(CheckCaseRecord(record));
  TF_RETURN_IF_ERROR(
      thread_->Run({.work = [most](Database& database) { return CheckRoom(database, most); }}));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<BlobStore::Incoming> file, blobs_->Receive());
  return std::make_unique<DurableCaseWriter>(std::move(record), most, thread_, blobs_,
                                             std::move(file));
}

absl::StatusOr<CaseRecord> DurableCaseStore::Find(const CaseKey& key) {
  return Ask<CaseRecord>(thread_, [&](Database& database) { return FindCase(database, key); });
}

absl::StatusOr<std::unique_ptr<CaseReader>> DurableCaseStore::Open(const CaseKey& key,
                                                                   int64_t now_s) {
  const std::string& sha256 = key.sha256;
  absl::Status damage = Damaged(absl::StrCat("case ", sha256), "its file is missing");
  for (int attempt = 0; attempt < kReadAttempts; ++attempt) {
    TF_ASSIGN_OR_RETURN(const CaseRecord record, Find(key));
    absl::StatusOr<OpenFile> file = blobs_->OpenBlob(sha256);
    if (absl::IsNotFound(file.status())) continue;
    TF_RETURN_IF_ERROR(file.status());
    const absl::Status size = CheckBlobSize(*blobs_, sha256, record.total_bytes);
    if (absl::IsDataLoss(size)) return SetBlobAside(thread_, blobs_, sha256, size);
    TF_RETURN_IF_ERROR(Touch(key, now_s));
    return std::make_unique<DurableCaseReader>(record, thread_, blobs_, *std::move(file));
  }
  return SetBlobAside(thread_, blobs_, sha256, damage);
}

absl::StatusOr<CaseStore::Page> DurableCaseStore::List(const ListRequest& request) {
  if (request.limit < 1) return BadLimit(request.limit);
  return Ask<Page>(thread_, [&](Database& database) {
    Database::Query query =
        database.Prepare(TF_SELECT_CASES
                         "WHERE sha256 > ? AND (? OR owner = ? OR sha256 || hex(owner) IN (SELECT "
                         "value FROM json_each(?))) ORDER BY sha256, owner");
    const std::string owner = request.owner.value_or("");
    const std::string also = KeysOf(request.also);
    query.Bind(request.after).Bind(int64_t{!request.owner.has_value()}).Bind(owner).Bind(also);
    return ReadPage<Page>(&query, request.limit, ReadCaseRow,
                          [](const CaseRecord& record) { return record.sha256; });
  });
}

absl::Status DurableCaseStore::Delete(const CaseKey& key) {
  return thread_->Run(
      {.work = [&](Database& database) { return DeleteCaseRow(database, key); },
       .after = [&](Database& database) { return RemoveUnclaimed(database, *blobs_, key.sha256); },
       .erases = true});
}

absl::Status DurableCaseStore::Touch(const CaseKey& key, int64_t now_s) {
  return thread_->Run(
      {.work = [&](Database& database) { return TouchCase(database, key, now_s); }});
}

absl::StatusOr<std::vector<CaseKey>> DurableCaseStore::RemoveUnused(
    int64_t before_s, const std::set<std::string>& spared, int most) {
  std::vector<CaseKey> removed;
  const auto remove_rows = [&](Database& database) -> absl::Status {
    removed.clear();
    {
      Database::Query query = database.Prepare(
          "SELECT sha256, owner FROM cases WHERE last_used_s < ? ORDER BY last_used_s, sha256, "
          "owner");
      query.Bind(before_s);
      while (removed.size() < static_cast<size_t>(most)) {
        TF_ASSIGN_OR_RETURN(const bool row, query.Step());
        if (!row) break;
        CaseKey key{.sha256 = std::string(query.Text(0)), .owner = std::string(query.Text(1))};
        if (!spared.contains(key.sha256)) removed.push_back(std::move(key));
      }
    }
    for (const CaseKey& key : removed) {
      TF_RETURN_IF_ERROR(DeleteCaseRow(database, key));
    }
    return absl::OkStatus();
  };
  const auto remove_files = [&](Database& database) -> absl::Status {
    for (const CaseKey& key : removed) {
      TF_RETURN_IF_ERROR(RemoveUnclaimed(database, *blobs_, key.sha256));
    }
    return absl::OkStatus();
  };
  TF_RETURN_IF_ERROR(thread_->Run({.work = remove_rows, .after = remove_files, .erases = true}));
  return removed;
}

}  // namespace tissueform
