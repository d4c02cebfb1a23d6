// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/queue/export_rows.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::Status NoExport() { return absl::NotFoundError("no such export in the queue"); }

absl::Status WriteRow(Database& database, const QueuedExport& changed) {
  const int64_t before = database.total_changes();
  TF_RETURN_IF_ERROR(database
                         .Prepare("UPDATE exports SET state = ?, note = ?, confirmed = ?, "
                                  "attempts = ?, last_error = ?, first_s = ?, done_s = ? WHERE "
                                  "name = ?")
                         .Bind(BridgeExportStateName(changed.state))
                         .Bind(changed.note)
                         .Bind(changed.confirmed)
                         .Bind(changed.attempts)
                         .Bind(changed.last_error)
                         .Bind(changed.first_s)
                         .Bind(changed.done_s)
                         .Bind(changed.name)
                         .Run());
  return database.total_changes() > before ? absl::OkStatus() : NoExport();
}

}  // namespace

absl::StatusOr<QueuedExport> ExportRows::Add(const QueuedExport& asked) {
  const absl::Status done = queue_->Change([&](Database& database) {
    return database
        .Prepare("INSERT OR IGNORE INTO exports VALUES (?, ?, ?, ?, ?, ?, '', 0, '', ?, 0)")
        .Bind(asked.name)
        .Bind(asked.key)
        .Bind(asked.prediction)
        .Bind(asked.case_name)
        .Bind(BridgeExportStateName(asked.state))
        .Bind(asked.note)
        .Bind(asked.first_s)
        .Run();
  });
  TF_RETURN_IF_ERROR(done);
  return Get(asked.name);
}

absl::Status ExportRows::Update(const QueuedExport& changed) {
  return queue_->Change([&](Database& database) { return WriteRow(database, changed); });
}

absl::Status ExportRows::UpdateWithPatient(const QueuedExport& changed,
                                           const std::string& study_uid,
                                           const PatientIdentity& patient) {
  return queue_->Change([&](Database& database) -> absl::Status {
    TF_RETURN_IF_ERROR(WriteRow(database, changed));
    return database
        .Prepare(
            "UPDATE studies SET patient_id = ?, issuer = ?, name = ?, birth_date = ?, "
            "readable = ? WHERE uid = ?")
        .Bind(patient.id)
        .Bind(patient.issuer)
        .Bind(patient.name)
        .Bind(patient.birth_date)
        .Bind(int64_t{patient.readable})
        .Bind(study_uid)
        .Run();
  });
}

absl::Status ExportRows::Confirm(const std::string& name, const std::string& digest) {
  TF_RETURN_IF_ERROR(Get(name).status());
  return queue_->Change([&](Database& database) -> absl::Status {
    const int64_t before = database.total_changes();
    TF_RETURN_IF_ERROR(
        database
            .Prepare("UPDATE exports SET state = 'confirmed', confirmed = ?, attempts = 0, "
                     "last_error = '' WHERE name = ? AND state = 'asked'")
            .Bind(digest)
            .Bind(name)
            .Run());
    if (database.total_changes() > before) return absl::OkStatus();
    return absl::FailedPreconditionError("the export does not wait for confirmation");
  });
}

absl::StatusOr<int> ExportRows::FailAsked(int64_t before_s, const std::string& note) {
  int64_t failed = 0;
  const absl::Status done = queue_->Change([&](Database& database) -> absl::Status {
    const int64_t before = database.total_changes();
    TF_RETURN_IF_ERROR(database
                           .Prepare("UPDATE exports SET state = 'failed', note = ?, attempts = 0, "
                                    "done_s = 0 WHERE state = 'asked' AND first_s < ?")
                           .Bind(note)
                           .Bind(before_s)
                           .Run());
    failed = database.total_changes() - before;
    return absl::OkStatus();
  });
  TF_RETURN_IF_ERROR(done);
  return static_cast<int>(failed);
}

absl::Status ExportRows::Remove(const std::string& name) {
  return queue_->Change([&](Database& database) -> absl::Status {
    TF_RETURN_IF_ERROR(database.Prepare("DELETE FROM objects WHERE export = ?").Bind(name).Run());
    return database.Prepare("DELETE FROM exports WHERE name = ?").Bind(name).Run();
  });
}

absl::StatusOr<QueuedExport> ExportRows::Get(const std::string& name) {
  QueuedExport found;
  const absl::Status done = queue_->Read([&](Database& database) -> absl::Status {
    Database::Query row = database.Prepare("SELECT * FROM exports WHERE name = ?");
    row.Bind(name);
    TF_ASSIGN_OR_RETURN(const bool any, row.Step());
    if (!any) return NoExport();
    TF_ASSIGN_OR_RETURN(found, ExportOf(row));
    return absl::OkStatus();
  });
  TF_RETURN_IF_ERROR(done);
  return found;
}

absl::StatusOr<std::vector<QueuedExport>> ExportRows::List() {
  std::vector<QueuedExport> all;
  const absl::Status done = queue_->Read([&](Database& database) -> absl::Status {
    Database::Query row = database.Prepare("SELECT * FROM exports ORDER BY first_s, name");
    for (;;) {
      TF_ASSIGN_OR_RETURN(const bool any, row.Step());
      if (!any) return absl::OkStatus();
      TF_ASSIGN_OR_RETURN(all.emplace_back(), ExportOf(row));
    }
  });
  TF_RETURN_IF_ERROR(done);
  return all;
}

absl::StatusOr<std::vector<QueuedObject>> ExportRows::EnsureObjects(
    const std::string& name, const std::vector<std::string>& keys, std::string (*make_uid)()) {
  const absl::Status done = queue_->Change([&](Database& database) -> absl::Status {
    for (const std::string& key : keys) {
      const std::string uid = make_uid();
      TF_RETURN_IF_ERROR(database.Prepare("INSERT OR IGNORE INTO objects VALUES (?, ?, ?, '', 0)")
                             .Bind(name)
                             .Bind(key)
                             .Bind(uid)
                             .Run());
    }
    return absl::OkStatus();
  });
  TF_RETURN_IF_ERROR(done);
  return ListObjects(name);
}

absl::StatusOr<std::vector<QueuedObject>> ExportRows::ListObjects(const std::string& name) {
  std::vector<QueuedObject> objects;
  const absl::Status done = queue_->Read([&](Database& database) -> absl::Status {
    Database::Query row =
        database.Prepare("SELECT key, uid, file, sent FROM objects WHERE export = ? ORDER BY key");
    row.Bind(name);
    for (;;) {
      TF_ASSIGN_OR_RETURN(const bool any, row.Step());
      if (!any) return absl::OkStatus();
      objects.push_back({TextOf(row, 0), TextOf(row, 1), TextOf(row, 2), row.Integer(3) != 0});
    }
  });
  TF_RETURN_IF_ERROR(done);
  return objects;
}

absl::Status ExportRows::UpdateObject(const std::string& name, const QueuedObject& object) {
  return queue_->Change([&](Database& database) {
    return database.Prepare("UPDATE objects SET file = ?, sent = ? WHERE export = ? AND key = ?")
        .Bind(object.file)
        .Bind(int64_t{object.sent})
        .Bind(name)
        .Bind(object.key)
        .Run();
  });
}

}  // namespace tissueform
