// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/connection_table.h"

#include <optional>

#include <sys/stat.h>

namespace tissueform {
namespace {

// Of an open descriptor; every socket has a number of its own for as long as the kernel runs.
std::optional<uint64_t> InodeOf(int fd) {
  struct stat status {};
  if (fstat(fd, &status) != 0 || !S_ISSOCK(status.st_mode)) return std::nullopt;
  return status.st_ino;
}

}  // namespace

ConnectionTable::Verdict ConnectionTable::Take(int fd, const std::string& address) {
  const std::optional<uint64_t> inode = InodeOf(fd);
  if (!inode.has_value()) return Verdict::kTooMany;  // closed already
  const auto full = [&] {
    return size() >= most_                        ? Verdict::kTooMany
           : CountOf(address) >= most_of_address_ ? Verdict::kTooManyOfAddress
                                                  : Verdict::kTaken;
  };
  // The number is in use again, so the connection that had it is closed.
  if (connections_.contains(fd) || full() != Verdict::kTaken) ForgetClosed();
  if (const Verdict verdict = full(); verdict != Verdict::kTaken) return verdict;
  connections_[fd] = {*inode, address};
  ++counts_[address];
  return Verdict::kTaken;
}

int ConnectionTable::CountOf(const std::string& address) const {
  const auto found = counts_.find(address);
  return found == counts_.end() ? 0 : found->second;
}

void ConnectionTable::ForgetClosed() {
  for (auto it = connections_.begin(); it != connections_.end();) {
    const std::optional<uint64_t> inode = InodeOf(it->first);
    if (inode.has_value() && *inode == it->second.inode) {
      ++it;
      continue;
    }
    if (const auto count = counts_.find(it->second.address); --count->second == 0) {
      counts_.erase(count);
    }
    it = connections_.erase(it);
  }
}

}  // namespace tissueform
