// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/access/auth/key_set.h"
#include "server/access/auth/revocation_list.h"

namespace tissueform {

// How the keys and the revocations of a server are, for its operator.
struct TokenStanding {
  int keys = 0;
  int64_t revocations = 0;
  std::chrono::system_clock::time_point keys_read = {};  // when they came last and were good
  // What came last was nonsense, or nothing came: what was there before stays.
  bool keys_alarm = false;
  bool revocations_alarm = false;
  int64_t alarms = 0;  // since the start
};

// The keys and the revocations that count now. New ones are taken if they are of use; if not, the
// old ones stay, and the standing has an alarm, which the caller logs. Thread-safe.
class TokenTrust {
 public:
  // `content`: of a file or a URL, or the error of reading it. `option` names the source:
  // "--token-keys".
  //
  // Errors: InvalidArgument (nonsense), or the one of `content`; both name the option.
  absl::Status TakeKeys(const char* option, const absl::StatusOr<std::string>& content);
  absl::Status TakeRevocations(const char* option, const absl::StatusOr<std::string>& content);

  // Never null; empty at first. The same pointer until there are others.
  std::shared_ptr<const KeySet> keys() const;
  std::shared_ptr<const RevocationList> revocations() const;
  TokenStanding standing() const;

 private:
  absl::Status Alarm(const char* option, const absl::Status& why, bool TokenStanding::*alarm);

  mutable Mutex mutex_;
  std::shared_ptr<const KeySet> keys_ ABSL_GUARDED_BY(mutex_) = std::make_shared<KeySet>();
  std::shared_ptr<const RevocationList> revocations_ ABSL_GUARDED_BY(mutex_) =
      std::make_shared<RevocationList>();
  TokenStanding standing_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
