// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/store/access_store/access_store.h"
#include "server/store/commit_thread.h"

namespace tissueform {

// Sealed rows of a database (store_schema.h).
class DurableAccessStore final : public AccessStore {
 public:
  // Must outlive it.
  explicit DurableAccessStore(CommitThread* thread) : thread_(thread) {}

  absl::StatusOr<AccessRows> Load() override;
  void Change(AccessRows erase, AccessRows put, std::function<void(absl::Status)> done) override;

 private:
  CommitThread* const thread_;
};

}  // namespace tissueform
