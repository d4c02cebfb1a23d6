// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/queue/draft_rows.h"

#include "core/base/status_macros.h"

namespace tissueform {

absl::Status DraftRows::Add(const QueuedDraft& draft) {
  return queue_->Change([&](Database& database) {
    return database.Prepare("INSERT OR REPLACE INTO drafts VALUES (?, ?, ?)")
        .Bind(draft.name)
        .Bind(draft.series)
        .Bind(draft.images)
        .Run();
  });
}

absl::StatusOr<std::vector<QueuedDraft>> DraftRows::List() {
  std::vector<QueuedDraft> drafts;
  const absl::Status done = queue_->Read([&](Database& database) -> absl::Status {
    Database::Query row =
        database.Prepare("SELECT name, series, images FROM drafts ORDER BY rowid");
    for (;;) {
      TF_ASSIGN_OR_RETURN(const bool found, row.Step());
      if (!found) return absl::OkStatus();
      drafts.push_back(
          {.name = TextOf(row, 0), .series = TextOf(row, 1), .images = row.Integer(2)});
    }
  });
  TF_RETURN_IF_ERROR(done);
  return drafts;
}

absl::Status DraftRows::Remove(const std::string& name) {
  return queue_->Change([&](Database& database) {
    return database.Prepare("DELETE FROM drafts WHERE name = ?").Bind(name).Run();
  });
}

absl::Status DraftRows::AddCase(const QueuedDraft& draft, const std::string& case_name) {
  return queue_->Change([&](Database& database) {
    return database.Prepare("INSERT OR IGNORE INTO cases VALUES (?, ?, ?)")
        .Bind(case_name)
        .Bind(draft.series)
        .Bind(draft.images)
        .Run();
  });
}

}  // namespace tissueform
