// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_updates.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "server/session/session_errors.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

bool SameHandleNames(const std::vector<HandleRegion>& a, const std::vector<HandleRegion>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const HandleRegion& x, const HandleRegion& y) { return x.name == y.name; });
}

}  // namespace

void SessionUpdates::Update(const std::string& id, const std::string& etag,
                            SessionFactory::Change change, const SessionCaller& caller, Done done) {
  // Before anything is prepared for a change that cannot be kept.
  auto checked = [etag, change = std::move(change)](
                     SessionRecord record,
                     const StoredMesh& mesh) -> absl::StatusOr<SessionRecord> {
    TF_RETURN_IF_ERROR(CheckSessionWrite(record.id, etag, record.epoch, record.etag, record.epoch));
    return change(std::move(record), mesh);
  };
  maker_->Remake(
      id, std::move(checked), caller,
      [this, caller, done = std::move(done)](absl::StatusOr<SessionFactory::Made> remade) {
        if (remade.ok()) {
          Keep(*std::move(remade), caller, done);
        } else {
          done(remade.status());
        }
      });
}

void SessionUpdates::Keep(SessionFactory::Made remade, const SessionCaller& caller, Done done) {
  // The last moment.
  absl::Status may_go_on = caller.cancellation.Check();
  if (may_go_on.ok()) may_go_on = remade.session->CheckHeld();
  if (!may_go_on.ok()) {
    remade.session.reset();
    done(may_go_on);
    return;
  }
  caller.Tell(SessionStage::kKeeping);
  const std::string id = remade.record.id;
  commits_->Hold(id);
  auto finish = [this, id, done = std::move(done)](absl::StatusOr<SessionFactory::Made> result) {
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
    const int64_t epoch = remade.session->epoch();
    store_->Update(std::move(remade.record), epoch,
                   [this, session = std::move(remade.session), other_handles,
                    finish = std::move(finish)](absl::StatusOr<SessionRecord> kept) mutable {
                     if (!kept.ok()) {
                       const absl::Status refusal = session->hold() == nullptr
                                                        ? kept.status()
                                                        : MovedIfFenced(kept.status());
                       session.reset();  // its memory is free before anybody hears of the failure
                       finish(refusal);
                       return;
                     }
                     SessionFactory::Made result{*std::move(kept), std::move(session)};
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
