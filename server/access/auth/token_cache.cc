// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_cache.h"

namespace tissueform {

std::optional<Authenticated> TokenCache::Find(const std::string& digest) {
  MutexLock lock(mutex_);
  const auto found = entries_.find(digest);
  if (found == entries_.end()) return std::nullopt;
  return found->second;
}

int64_t TokenCache::generation() const {
  MutexLock lock(mutex_);
  return generation_;
}

void TokenCache::Insert(const std::string& digest, const Authenticated& authenticated,
                        int64_t generation) {
  MutexLock lock(mutex_);
  if (generation != generation_ || !entries_.emplace(digest, authenticated).second) return;
  order_.push_back(digest);
  if (order_.size() <= most_) return;
  entries_.erase(order_.front());
  order_.pop_front();
}

void TokenCache::Clear() {
  MutexLock lock(mutex_);
  ++generation_;
  entries_.clear();
  order_.clear();
}

size_t TokenCache::size() const {
  MutexLock lock(mutex_);
  return entries_.size();
}

}  // namespace tissueform
