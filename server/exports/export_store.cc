// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/exports/export_store.h"

#include <cstdlib>
#include <map>
#include <utility>

#include "core/base/mutex.h"
#include "core/base/status_macros.h"
#include "server/store/claimed_blobs.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

// Of a server that keeps nothing.
class InMemoryExportStore final : public ExportStore {
 public:
  absl::StatusOr<std::vector<ExportRecord>> Load() override {
    std::vector<ExportRecord> records;
    MutexLock lock(mutex_);
    for (const auto& [id, record] : records_) records.push_back(record);
    return records;
  }

  absl::Status Put(const ExportRecord& record) override {
    MutexLock lock(mutex_);
    records_[record.id] = record;
    return absl::OkStatus();
  }

  absl::Status Erase(const std::vector<std::string>& ids) override {
    MutexLock lock(mutex_);
    for (const std::string& id : ids) records_.erase(id);
    return absl::OkStatus();
  }

 private:
  Mutex mutex_;
  std::map<std::string, ExportRecord> records_ ABSL_GUARDED_BY(mutex_);
};

// Sealed rows of a database (store_schema.h).
class DurableExportStore final : public ExportStore {
 public:
  explicit DurableExportStore(CommitThread* thread) : thread_(thread) {}

  absl::StatusOr<std::vector<ExportRecord>> Load() override {
    return Ask<std::vector<ExportRecord>>(
        thread_, [](Database& database) -> absl::StatusOr<std::vector<ExportRecord>> {
          std::vector<ExportRecord> records;
          Database::Query query =
              database.Prepare("SELECT name, record FROM exports ORDER BY name");
          for (;;) {
            TF_ASSIGN_OR_RETURN(const bool found, query.Step());
            if (!found) return records;
            const absl::StatusOr<absl::string_view> bytes = Unseal(query.Bytes(1));
            if (!bytes.ok()) continue;
            absl::StatusOr<ExportRecord> record = ParseExport(*bytes);
            if (record.ok() && record->id == query.Text(0)) records.push_back(*std::move(record));
          }
        });
  }

  absl::Status Put(const ExportRecord& record) override {
    const std::string bytes = Seal(SerializeExport(record));
    return thread_->Run({.work = [&](Database& database) {
      return database.Prepare("INSERT OR REPLACE INTO exports (name, record) VALUES (?, ?)")
          .Bind(record.id)
          .BindBytes(bytes)
          .Run();
    }});
  }

  absl::Status Erase(const std::vector<std::string>& ids) override {
    return thread_->Run(
        {.work = [&](Database& database) -> absl::Status {
           for (const std::string& id : ids) {
             TF_RETURN_IF_ERROR(
                 database.Prepare("DELETE FROM exports WHERE name = ?").Bind(id).Run());
           }
           return absl::OkStatus();
         },
         .erases = true});
  }

 private:
  CommitThread* const thread_;
};

}  // namespace

std::unique_ptr<ExportStore> OpenExportStore(Stores* stores) {
  if (!stores->keeps()) return std::make_unique<InMemoryExportStore>();
  // In memory they would be lost in silence: such a store has rows of its own.
  if (stores->commit_thread() == nullptr) std::abort();
  return std::make_unique<DurableExportStore>(stores->commit_thread());
}

}  // namespace tissueform
