// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_updates.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

bool SameHandleNames(const std::vector<HandleRegion>& a, const std::vector<HandleRegion>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const HandleRegion& x, const HandleRegion& y) { return x.name == y.name; });
}

}  // namespace

void SessionUpdates::Update(const std::string& id, const std::string& etag,
                            SessionMaker::Change change, const SessionCaller& caller, Done done) {
  // Before anything is prepared for a change that cannot be kept.
  auto checked = [etag, change = std::move(change)](
                     SessionRecord record,
                     const StoredMesh& mesh) -> absl::StatusOr<SessionRecord> {
    TF_RETURN_IF_ERROR(CheckSessionWrite(record.id, etag, kStoreEpoch, record.etag, record.epoch));
    return change(std::move(record), mesh);
  };
  maker_->Remake(id, std::move(checked), caller,
                 [this, caller, done = std::move(done)](absl::StatusOr<SessionMaker::Made> remade) {
                   if (remade.ok()) {
                     Keep(*std::move(remade), caller, done);
                   } else {
                     done(remade.status());
                   }
                 });
}

void SessionUpdates::Keep(SessionMaker::Made remade, const SessionCaller& caller, Done done) {
  // The last moment.
  if (const absl::Status wanted = caller.cancellation.Check(); !wanted.ok()) {
    remade.session.reset();
    done(wanted);
    return;
  }
  caller.Tell(SessionStage::kKeeping);
  const std::string id = remade.record.id;
  commits_->Hold(id);
  auto finish = [this, id, done = std::move(done)](absl::StatusOr<SessionMaker::Made> result) {
    commits_->Release(id);
    done(std::move(result));
  };
  // Once more: poses may have been committed while it was prepared.
  store_->Get(id, [this, remade = std::move(remade),
                   finish = std::move(finish)](absl::StatusOr<SessionRecord> current) mutable {
    if (!current.ok()) {
      remade.session.reset();
      finish(current.status());
      return;
    }
    const bool other_handles = !SameHandleNames(current->handles, remade.record.handles);
    remade.record.last_poses =
        other_handles ? std::vector<HandlePose>() : std::move(current->last_poses);
    store_->Update(std::move(remade.record), kStoreEpoch,
                   [this, session = std::move(remade.session), other_handles,
                    finish = std::move(finish)](absl::StatusOr<SessionRecord> kept) mutable {
                     if (!kept.ok()) {
                       session.reset();  // its memory is free before anybody hears of the failure
                       finish(kept.status());
                       return;
                     }
                     SessionMaker::Made result{*std::move(kept), std::move(session)};
                     const absl::Status status = replace_(result, other_handles);
                     if (status.ok()) {
                       finish(std::move(result));
                     } else {
                       result.session.reset();
                       finish(status);
                     }
                   });
  });
}

}  // namespace tissueform
