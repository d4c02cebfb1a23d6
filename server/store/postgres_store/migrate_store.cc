// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/migrate_store.h"

#include <algorithm>
#include <future>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/exports/export_store.h"
#include "server/store/access_store/access_store.h"
#include "server/store/postgres_store/postgres_access_store.h"
#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/postgres_store/postgres_export_store.h"
#include "server/store/postgres_store/postgres_schema.h"
#include "server/store/postgres_store/postgres_session_rows.h"

namespace tissueform {
namespace {

constexpr int kMigrationPage = 100;

absl::Status CheckEmpty(PostgresPool* pool) {
  return pool->Run([&](PostgresTransaction& transaction) -> absl::Status {
    for (const char* table :
         {"sessions", "blobs", "shares", "follow_links", "mesh_rights", "exports"}) {
      const std::string sql = absl::StrCat("SELECT 1 FROM ", table, " LIMIT 1");
      TF_ASSIGN_OR_RETURN(const PostgresRows rows, transaction.Query(sql.c_str(), {}));
      if (rows.empty()) continue;
      return absl::FailedPreconditionError(absl::StrCat("database ", pool->target().name,
                                                        " is not empty (there are ", table,
                                                        "); name one that is"));
    }
    return absl::OkStatus();
  });
}

template <typename Result, typename Call>
Result AnswerOf(Call call) {
  std::promise<Result> answer;
  call([&answer](Result result) { answer.set_value(std::move(result)); });
  return answer.get_future().get();
}

absl::Status InsertAll(const std::vector<SessionRecord>& records, PostgresPool* to) {
  return to->Run([&](PostgresTransaction& transaction) -> absl::Status {
    for (const SessionRecord& record : records) {
      TF_RETURN_IF_ERROR(InsertSession(transaction, record).status());
    }
    return RaiseSessionEpochs(transaction);
  });
}

absl::StatusOr<int64_t> MigrateSessions(SessionStore& from, PostgresPool* to) {
  int64_t count = 0;
  SessionStore::ListRequest request{.limit = kMigrationPage};
  do {
    TF_ASSIGN_OR_RETURN(const SessionStore::Page page, AnswerOf<absl::StatusOr<SessionStore::Page>>(
                                                           [&](SessionStore::PageCallback done) {
                                                             from.List(request, std::move(done));
                                                           }));
    TF_RETURN_IF_ERROR(InsertAll(page.records, to));
    count += static_cast<int64_t>(page.records.size());
    request.after = page.next;
  } while (!request.after.empty());
  return count;
}

absl::StatusOr<int64_t> MigrateMeshes(MeshStore& from, MeshStore& to) {
  int64_t count = 0;
  std::string after;
  do {
    TF_ASSIGN_OR_RETURN(const MeshStore::Page page, from.List(after, kMigrationPage));
    for (const MeshRecord& record : page.records) {
      TF_ASSIGN_OR_RETURN(const MeshPayload payload, from.Read(record.sha256));
      TF_RETURN_IF_ERROR(to.Put(record, payload.View()));
    }
    count += static_cast<int64_t>(page.records.size());
    after = page.next;
  } while (!after.empty());
  return count;
}

absl::StatusOr<int64_t> MigratePredictions(PredictionStore& from, PredictionStore& to) {
  int64_t count = 0;
  PredictionStore::ListRequest request{.limit = kMigrationPage};
  do {
    TF_ASSIGN_OR_RETURN(const PredictionStore::Page page, from.List(request));
    for (const PredictionRecord& record : page.records) {
      TF_ASSIGN_OR_RETURN(const std::string positions, from.Positions(record.id));
      TF_RETURN_IF_ERROR(to.Create(record, positions));
    }
    count += static_cast<int64_t>(page.records.size());
    request.after = page.next;
  } while (!request.after.empty());
  return count;
}

absl::Status MigrateCase(CaseStore& from, const CaseRecord& record, CaseStore& to) {
  // Opening is a use, as any other; the record that is carried over is that of before.
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<CaseReader> reader,
                      from.Open(record.key(), record.last_used_s));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<CaseWriter> writer,
                      to.Begin(record, std::numeric_limits<int>::max()));
  for (int64_t offset = 0; offset < record.total_bytes; offset += kBlobPieceBytes) {
    TF_ASSIGN_OR_RETURN(
        const std::string bytes,
        reader->Read(offset, std::min(kBlobPieceBytes, record.total_bytes - offset)));
    TF_RETURN_IF_ERROR(writer->Write(offset, bytes));
  }
  return writer->Finish().status();
}

absl::StatusOr<int64_t> MigrateCases(CaseStore& from, CaseStore& to) {
  int64_t count = 0;
  // Those of one name may be parted by the end of a page: all in one.
  TF_ASSIGN_OR_RETURN(const CaseStore::Page page,
                      from.List({.limit = std::numeric_limits<int>::max()}));
  for (const CaseRecord& record : page.records) {
    TF_RETURN_IF_ERROR(MigrateCase(from, record, to));
    ++count;
  }
  return count;
}

absl::StatusOr<int64_t> MigrateAccess(Stores* from, PostgresPool* to) {
  TF_ASSIGN_OR_RETURN(AccessRows rows, OpenAccessStore(from)->Load());
  const auto count =
      static_cast<int64_t>(rows.shares.size() + rows.links.size() + rows.mesh_rights.size());
  PostgresAccessStore store(to);
  TF_RETURN_IF_ERROR(AnswerOf<absl::Status>([&](std::function<void(absl::Status)> done) {
    store.Change({}, std::move(rows), std::move(done));
  }));
  return count;
}

absl::StatusOr<int64_t> MigrateExports(Stores* from, PostgresPool* to) {
  TF_ASSIGN_OR_RETURN(const std::vector<ExportRecord> records, OpenExportStore(from)->Load());
  PostgresExportStore store(to);
  TF_RETURN_IF_ERROR(store.PutAll(records));
  return static_cast<int64_t>(records.size());
}

}  // namespace

absl::StatusOr<MigrationSummary> MigrateStore(Stores* from, PostgresStores* to) {
  TF_RETURN_IF_ERROR(CheckEmpty(to->pool()));
  MigrationSummary summary;
  TF_ASSIGN_OR_RETURN(summary.meshes, MigrateMeshes(from->meshes(), to->meshes()));
  TF_ASSIGN_OR_RETURN(summary.cases, MigrateCases(from->cases(), to->cases()));
  TF_ASSIGN_OR_RETURN(summary.predictions,
                      MigratePredictions(from->predictions(), to->predictions()));
  TF_ASSIGN_OR_RETURN(summary.access_rows, MigrateAccess(from, to->pool()));
  TF_ASSIGN_OR_RETURN(summary.exports, MigrateExports(from, to->pool()));
  TF_ASSIGN_OR_RETURN(summary.sessions, MigrateSessions(from->sessions(), to->pool()));
  return summary;
}

}  // namespace tissueform
