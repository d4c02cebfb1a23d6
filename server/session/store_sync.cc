// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/store_sync.h"

#include <future>
#include <optional>
#include <utility>

#include "absl/status/statusor.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kNewsPageSize = 1000;

absl::StatusOr<SessionStore::Page> ListAndWait(SessionStore* store,
                                               const SessionStore::ListRequest& request) {
  std::promise<absl::StatusOr<SessionStore::Page>> answer;
  store->List(request, [&answer](absl::StatusOr<SessionStore::Page> page) {
    answer.set_value(std::move(page));
  });
  return answer.get_future().get();
}

}  // namespace

SessionEntry StoreSync::KnownFrom(const SessionRecord& record) const {
  SessionEntry known;
  known.key = RequestKeyOf(record);
  known.owner = record.owner;
  known.mesh_sha256 = record.mesh_sha256;
  known.last_used = clock_->Now();
  return known;
}

absl::Status StoreSync::LearnKnown() {
  SessionStore::ListRequest request{.owner = std::nullopt, .after = "", .limit = kNewsPageSize};
  do {
    TF_ASSIGN_OR_RETURN(SessionStore::Page page, ListAndWait(store_, request));
    for (const SessionRecord& record : page.records) OnCreated(record);
    request.after = std::move(page.next);
  } while (!request.after.empty());
  return absl::OkStatus();
}

void StoreSync::OnCreated(const SessionRecord& record) {
  MutexLock lock(sessions_->mutex);
  SessionTable& table = sessions_->table;
  if (table.Find(record.id) != nullptr || table.FindMaking(record.id) != nullptr ||
      table.IsEnding(record.id)) {
    return;
  }
  table.Add(record.id, KnownFrom(record));
}

void StoreSync::Changed(const SessionRecord& record) {
  {
    MutexLock lock(sessions_->mutex);
    if (SessionEntry* known = sessions_->table.Find(record.id); known != nullptr) {
      if (known->session != nullptr && known->session->CheckHeld().ok()) return;
      known->owner = record.owner;
      known->mesh_sha256 = record.mesh_sha256;
      return;
    }
  }
  OnCreated(record);
}

SessionStore::RecordCallback StoreSync::Learning(const std::function<void(absl::Status)>& done) {
  return [this, done](const absl::StatusOr<SessionRecord>& record) {
    if (record.ok()) OnCreated(*record);
    done(record.status());
  };
}

void StoreSync::Ask(const std::string& id, const std::function<void(absl::Status)>& done) {
  store_->Get(id, Learning(done));
}

void StoreSync::AskBriefly(const std::string& id, const std::function<void(absl::Status)>& done) {
  store_->Peek(id, Learning(done));
}

}  // namespace tissueform
