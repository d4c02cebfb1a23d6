// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/access_audit.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

AuditParticipant Remote(const std::string& name, const std::string& ae_title,
                        const std::string& address) {
  return {.user_id = name.empty() ? "unknown" : name,
          .ae_title = ae_title,
          .host = address,
          .is_requestor = true};
}

}  // namespace

AccessAudit::AccessAudit(BridgeAudit* audit, const Options& options)
    : audit_(audit), options_(options), limit_(options.limit), thread_([this] { Run(); }) {}

AccessAudit::~AccessAudit() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
  }
  changed_.NotifyAll();
  thread_.join();
}

void AccessAudit::ConnectionRefused(const RefusedConnection& refused) {
  WriteRefusal({.kind = AuditEvent::Kind::kNodeRefused,
                .outcome = absl::PermissionDeniedError(refused.reason),
                .participants = {Remote(refused.calling_ae, refused.calling_ae, refused.address)}},
               refused.address);
}

void AccessAudit::LoginRefused(const std::string& address, const std::string& user) {
  WriteRefusal({.kind = AuditEvent::Kind::kLogin,
                .outcome = absl::UnauthenticatedError("wrong password of the review page"),
                .participants = {Remote(user, /*ae_title=*/"", address)}},
               address);
}

absl::Status AccessAudit::LoginAccepted(const std::string& address, const std::string& user) {
  MutexLock lock(mutex_);
  const User key = {address, user};
  const Clock::time_point now = Clock::now();
  const auto known = last_seen_.find(key);
  if (known == last_seen_.end() || now - known->second >= options_.max_silence) {
    TF_RETURN_IF_ERROR(audit_->Reserve(1));
    audit_->Write({.kind = AuditEvent::Kind::kLogin,
                   .participants = {Remote(user, /*ae_title=*/"", address),
                                    audit_->Self(AuditParticipant::Role::kApplication,
                                                 /*is_requestor=*/false)}});
  }
  Remember(key, now);
  return absl::OkStatus();
}

void AccessAudit::Remember(const User& user, Clock::time_point now) {
  if (!last_seen_.contains(user) && last_seen_.size() >= options_.max_users) {
    last_seen_.erase(std::min_element(
        last_seen_.begin(), last_seen_.end(),
        [](const auto& left, const auto& right) { return left.second < right.second; }));
  }
  last_seen_[user] = now;
}

void AccessAudit::WriteRefusal(AuditEvent event, const std::string& address) {
  event.participants.push_back(
      audit_->Self(AuditParticipant::Role::kApplication, /*is_requestor=*/false));
  MutexLock lock(mutex_);
  if (limit_.Admit(address, Clock::now())) {
    audit_->WriteIfRoom(std::move(event));
  } else {
    changed_.NotifyAll();
  }
}

void AccessAudit::WriteDropped() {
  const std::string text =
      absl::StrCat(limit_.TakeDropped(), " more refusals were not recorded one by one; ",
                   options_.limit.max_per_source, " of each address are in a minute");
  audit_->WriteIfRoom({.kind = AuditEvent::Kind::kNodeRefused,
                       .outcome = absl::ResourceExhaustedError(text),
                       .participants = {audit_->Self(AuditParticipant::Role::kApplication,
                                                     /*is_requestor=*/false)}});
}

void AccessAudit::Run() {
  MutexLock lock(mutex_);
  while (true) {
    while (limit_.dropped() == 0 && !ending_) changed_.Wait(mutex_);
    if (limit_.dropped() == 0) return;
    const Clock::time_point end = limit_.period_end();
    while (!ending_ && Clock::now() < end) changed_.WaitUntil(mutex_, end);
    WriteDropped();
  }
}

}  // namespace tissueform
