// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/watches/session_watches.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "google/protobuf/util/time_util.h"

#include "core/base/error_reason.h"
#include "server/session/session_errors.h"

namespace tissueform {
namespace {

absl::Status TooManyWatches(int limit, absl::string_view what, absl::string_view option) {
  return WithReason(
      absl::ResourceExhaustedError(absl::StrCat(
          what, " has ", limit, " watches, which is the limit", "; close one or raise ", option)),
      ErrorReason::kTooManyWatches, {{"limit", absl::StrCat(limit)}});
}

absl::Status SessionDeleted(const std::string& id) {
  return WithReason(
      absl::NotFoundError(absl::StrCat("the session \"sessions/", id, "\" was deleted")),
      ErrorReason::kSessionNotFound);
}

}  // namespace

v1::DeformNotice DrainingAt(std::chrono::system_clock::time_point end) {
  v1::DeformNotice notice;
  *notice.mutable_draining()->mutable_end_time() =
      google::protobuf::util::TimeUtil::MillisecondsToTimestamp(
          std::chrono::duration_cast<std::chrono::milliseconds>(end.time_since_epoch()).count());
  return notice;
}

std::shared_ptr<WatchChannel> SessionWatches::ChannelOf(const std::string& session_id) {
  MutexLock lock(mutex_);
  return FindChannel(session_id);
}

std::shared_ptr<WatchChannel> SessionWatches::FindChannel(const std::string& session_id) {
  std::weak_ptr<WatchChannel>& known = channels_[session_id];
  std::shared_ptr<WatchChannel> channel = known.lock();
  if (channel == nullptr) {
    channel = std::make_shared<WatchChannel>(pool_);
    known = channel;
    std::erase_if(channels_, [](const auto& entry) { return entry.second.expired(); });
  }
  return channel;
}

absl::StatusOr<SessionWatches::Joined> SessionWatches::Add(const std::string& watch,
                                                           const std::string& session_id,
                                                           CreditedWatcher* watcher,
                                                           const std::string& principal) {
  MutexLock lock(mutex_);
  if (watches_.size() >= static_cast<size_t>(limits_.max_watches)) {
    return TooManyWatches(limits_.max_watches, "the server", "--max-watches");
  }
  Joined joined{.channel = FindChannel(session_id)};
  if (joined.channel->num_watchers() >= static_cast<size_t>(limits_.max_watches_per_session)) {
    return TooManyWatches(limits_.max_watches_per_session, "the session",
                          "--max-watches-per-session");
  }
  watches_[watch] = {watcher, joined.channel, principal};
  joined.has_frame = joined.channel->Add(watcher);
  return joined;
}

void SessionWatches::Remove(const std::string& watch) {
  MutexLock lock(mutex_);
  const auto found = watches_.find(watch);
  if (found == watches_.end()) return;
  found->second.channel->Remove(found->second.watcher);
  watches_.erase(found);
}

absl::Status SessionWatches::Acknowledge(const std::string& watch, uint64_t number,
                                         const Authenticated& by) {
  MutexLock lock(mutex_);
  const auto found = watches_.find(watch);
  const std::string& principal = by.principal == nullptr ? std::string() : by.principal->name;
  if (found != watches_.end() && found->second.principal == principal) {
    return found->second.watcher->Acknowledge(number, by);
  }
  return WithReason(absl::NotFoundError(absl::StrCat("no watch \"watches/", watch,
                                                     "\": it has ended; begin a new one")),
                    ErrorReason::kWatchNotFound);
}

void SessionWatches::OnSessionEvent(const std::string& session_id, SessionEvent event) {
  MutexLock lock(mutex_);
  const auto found = channels_.find(session_id);
  const std::shared_ptr<WatchChannel> channel =
      found == channels_.end() ? nullptr : found->second.lock();
  if (channel == nullptr) return;
  v1::DeformNotice notice;
  switch (event) {
    case SessionEvent::kDeleted:
      // The next session of this id is another one.
      channels_.erase(found);
      channel->EndWatches(SessionDeleted(session_id));
      return;
    case SessionEvent::kMoved:
      // A new watch here begins with the committed pose, not with an earlier frame.
      channels_.erase(found);
      channel->EndWatches(SessionMoved(""));
      return;
    case SessionEvent::kEvicted:
      notice.mutable_evicted();
      break;
    case SessionEvent::kRestored:
      notice.mutable_restored();
      break;
  }
  channel->Notify(notice);
}

void SessionWatches::NotifyDraining(std::chrono::system_clock::time_point end) {
  const v1::DeformNotice notice = DrainingAt(end);
  MutexLock lock(mutex_);
  for (const auto& [session_id, weak] : channels_) {
    const std::shared_ptr<WatchChannel> channel = weak.lock();
    if (channel == nullptr) continue;
    channel->Notify(notice);
    channel->EndWithDrags(
        WithReason(absl::UnavailableError("the server is draining, and no drag is open; "
                                          "watch again in a minute"),
                   ErrorReason::kServerDraining));
  }
}

std::map<std::string, int64_t> SessionWatches::CountByPrincipal() const {
  std::map<std::string, int64_t> counts;
  MutexLock lock(mutex_);
  for (const auto& [name, watch] : watches_) ++counts[watch.principal];
  return counts;
}

int SessionWatches::size() const {
  MutexLock lock(mutex_);
  return static_cast<int>(watches_.size());
}

}  // namespace tissueform
