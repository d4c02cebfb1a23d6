// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/session/pose_commits.h"
#include "server/session/session.h"
#include "server/session/session_factory.h"
#include "server/store/session_store.h"

namespace tissueform {

// How a session is changed: made anew beside the old one, its record kept if nobody was faster,
// then put into its place by whoever knows the sessions.
//
// Thread-safe.
class SessionUpdates {
 public:
  using Done = std::function<void(absl::StatusOr<SessionFactory::Made>)>;
  // Puts a session whose record is kept into its place; not OK when there is none any more.
  using Replace =
      std::function<absl::Status(const SessionFactory::Made& remade, bool other_handles)>;

  // All must outlive it.
  SessionUpdates(SessionFactory* maker, SessionStore* store, PoseCommits* commits, Replace replace)
      : maker_(maker), store_(store), commits_(commits), replace_(std::move(replace)) {}

  // `etag` is that of the version that is changed; empty: whatever it is. `done` gets the record as
  // it is kept. Committed poses stay where the handles' names and their order do.
  //
  // Errors: Aborted (another version), those of SessionFactory::Remake, SessionStore::Update and
  // `replace`.
  void Update(const std::string& id, const std::string& etag, SessionFactory::Change change,
              const SessionCaller& caller, Done done);

 private:
  void Keep(SessionFactory::Made remade, const SessionCaller& caller, Done done);

  SessionFactory* const maker_;
  SessionStore* const store_;
  PoseCommits* const commits_;
  const Replace replace_;
};

}  // namespace tissueform
