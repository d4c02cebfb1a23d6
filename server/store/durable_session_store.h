// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "server/store/commit_thread.h"
#include "server/store/session_store.h"

namespace tissueform {

// Sessions as rows of a database; answered on its thread.
class DurableSessionStore final : public SessionStore {
 public:
  // `thread` must outlive it.
  DurableSessionStore(CommitThread* thread, UnixClock clock)
      : thread_(thread), clock_(std::move(clock)) {}

  void Create(SessionRecord record, int64_t epoch, RecordCallback done) override;
  void Get(const std::string& id, RecordCallback done) override;
  void Peek(const std::string& id, RecordCallback done) override { Get(id, std::move(done)); }
  void Update(SessionRecord record, int64_t epoch, RecordCallback done) override;
  void CommitPoses(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
                   StatusCallback done) override;
  void Delete(const std::string& id, const std::string& etag, int64_t epoch,
              StatusCallback done) override;
  void List(const ListRequest& request, PageCallback done) override;
  void Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) override;
  void ListUnused(int64_t before_s, int limit, PageCallback done) override;

 private:
  // Answers with what the last call of `work` has returned.
  template <typename Result>
  void Submit(std::function<absl::StatusOr<Result>(Database&)> work,
              std::function<void(absl::StatusOr<Result>)> done);

  CommitThread* const thread_;
  const UnixClock clock_;
};

}  // namespace tissueform
