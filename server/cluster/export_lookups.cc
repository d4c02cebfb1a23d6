// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/cluster/export_lookups.h"

#include <future>
#include <utility>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxRemembered = 10'000;

}  // namespace

int64_t ExportLookups::lookups() const {
  MutexLock lock(mutex_);
  return lookups_;
}

absl::StatusOr<bool> ExportLookups::Begin(const std::string& id) {
  const auto now = std::chrono::steady_clock::now();
  MutexLock lock(mutex_);
  const auto missing = missing_.find(id);
  if (missing != missing_.end() && now < missing->second) return false;
  while (reading_ >= kMaxAtOnce && now >= silent_until_) {
    if (!place_.WaitUntil(mutex_, now + kPatience) && reading_ >= kMaxAtOnce) break;
  }
  if (reading_ >= kMaxAtOnce || now < silent_until_) {
    return absl::UnavailableError(
        "the resource is unknown here, and the database does not answer; try again");
  }
  if (missing_.size() >= kMaxRemembered) missing_.clear();
  ++reading_;
  ++lookups_;
  return true;
}

absl::Status ExportLookups::Read(const std::string& id, const std::function<absl::Status()>& read) {
  TF_ASSIGN_OR_RETURN(const bool begun, Begin(id));
  if (!begun) return absl::OkStatus();
  const absl::Status status = read();
  const auto until = std::chrono::steady_clock::now() + kRemembered;
  MutexLock lock(mutex_);
  --reading_;
  place_.NotifyAll();
  missing_[id] = until;  // not again at once, whether it was found or not
  if (!absl::IsUnavailable(status)) return absl::OkStatus();
  silent_until_ = until;
  return status;
}

}  // namespace tissueform
