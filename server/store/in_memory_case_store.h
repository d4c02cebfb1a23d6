// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/cord.h"

#include "core/base/mutex.h"
#include "server/store/case_store.h"

namespace tissueform {

// Cases of a server that keeps nothing: they go with the process, and no file of them is left
// behind when it is killed.
class InMemoryCaseStore final : public CaseStore {
 public:
  // Where the disk bounds a store on a disk, this bounds one that takes memory from sessions.
  static constexpr int64_t kMaxBytes = int64_t{1} << 30;

  // Refuses (ResourceExhausted) what would make it hold more than `most_bytes`, those on their way
  // included.
  explicit InMemoryCaseStore(int64_t most_bytes = kMaxBytes) : most_bytes_(most_bytes) {}

  absl::StatusOr<std::unique_ptr<CaseWriter>> Begin(CaseRecord record, int most) override;
  absl::StatusOr<CaseRecord> Find(const CaseKey& key) override;
  absl::StatusOr<std::unique_ptr<CaseReader>> Open(const CaseKey& key, int64_t now_s) override;
  absl::StatusOr<Page> List(const ListRequest& request) override;
  absl::Status Delete(const CaseKey& key) override;
  absl::Status Touch(const CaseKey& key, int64_t now_s) override;
  absl::StatusOr<std::vector<CaseKey>> RemoveUnused(int64_t before_s,
                                                    const std::set<std::string>& spared,
                                                    int most) override;

 private:
  class Writer;
  class Reader;
  struct Case {
    CaseRecord record;
    absl::Cord bytes;
  };

  absl::Status Reserve(int64_t bytes);
  void Release(int64_t bytes);
  // Keeps it unless it is there; takes over the reservation of its bytes then.
  absl::StatusOr<CaseRecord> Keep(const CaseRecord& record, const absl::Cord& bytes, int most,
                                  bool* taken);

  const int64_t most_bytes_;
  Mutex mutex_;
  int64_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<CaseKey, Case> cases_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
