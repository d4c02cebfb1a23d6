// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/token_trust.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

namespace tissueform {

absl::Status TokenTrust::Alarm(const char* option, const absl::Status& why,
                               bool TokenStanding::*alarm) {
  const absl::Status named(why.code(), absl::StrCat(option, ": ", why.message()));
  MutexLock lock(mutex_);
  standing_.*alarm = true;
  ++standing_.alarms;
  return named;
}

absl::Status TokenTrust::TakeKeys(const char* option, const absl::StatusOr<std::string>& content) {
  auto keys = content.ok() ? KeySet::Parse(*content) : content.status();
  if (!keys.ok()) return Alarm(option, keys.status(), &TokenStanding::keys_alarm);
  MutexLock lock(mutex_);
  standing_.keys_alarm = false;
  standing_.keys_read = std::chrono::system_clock::now();
  if ((*keys)->SameAs(*keys_)) return absl::OkStatus();
  keys_ = *std::move(keys);
  standing_.keys = keys_->size();
  spdlog::info("{}: {} keys for tokens", option, keys_->size());
  return absl::OkStatus();
}

absl::Status TokenTrust::TakeRevocations(const char* option,
                                         const absl::StatusOr<std::string>& content) {
  auto list = content.ok() ? RevocationList::Parse(*content) : content.status();
  if (!list.ok()) return Alarm(option, list.status(), &TokenStanding::revocations_alarm);
  MutexLock lock(mutex_);
  standing_.revocations_alarm = false;
  revocations_ = *std::move(list);
  standing_.revocations = static_cast<int64_t>(revocations_->size());
  spdlog::info("{}: {} revocations", option, revocations_->size());
  return absl::OkStatus();
}

std::shared_ptr<const KeySet> TokenTrust::keys() const {
  MutexLock lock(mutex_);
  return keys_;
}

std::shared_ptr<const RevocationList> TokenTrust::revocations() const {
  MutexLock lock(mutex_);
  return revocations_;
}

TokenStanding TokenTrust::standing() const {
  MutexLock lock(mutex_);
  return standing_;
}

}  // namespace tissueform
