// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <deque>
#include <optional>
#include <string>

#include "absl/container/flat_hash_map.h"

#include "core/base/mutex.h"
#include "server/access/auth/authenticator.h"

namespace tissueform {

// Who the tokens that were verified belong to, by SHA-256 of the tokens: a signature costs 20 times
// as much as all else of a small call. Of a full cache the oldest entry goes. Thread-safe.
class TokenCache {
 public:
  explicit TokenCache(size_t most = 4096) : most_(most) {}

  // Empty: not known. The caller still checks the expiry and whether the token was revoked.
  std::optional<Authenticated> Find(const std::string& digest);

  // Which keys it stands on: taken before a token is verified, it says whether what comes out is
  // still to be believed.
  int64_t generation() const;
  // Nothing where the cache was cleared since `generation`.
  void Insert(const std::string& digest, const Authenticated& authenticated, int64_t generation);

  // The keys have changed.
  void Clear();
  size_t size() const;

 private:
  const size_t most_;

  mutable Mutex mutex_;
  int64_t generation_ ABSL_GUARDED_BY(mutex_) = 0;
  absl::flat_hash_map<std::string, Authenticated> entries_ ABSL_GUARDED_BY(mutex_);
  std::deque<std::string> order_ ABSL_GUARDED_BY(mutex_);  // digests, oldest first
};

}  // namespace tissueform
