// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_table.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace tissueform {

bool PendingSession::wanted() const {
  return std::any_of(waiters.begin(), waiters.end(),
                     [](const SessionWaiter& waiter) { return !waiter.cancelled->load(); });
}

SessionEntry* SessionTable::Find(const std::string& id) {
  const auto found = known_.find(id);
  return found == known_.end() ? nullptr : &found->second;
}

const SessionEntry* SessionTable::Find(const std::string& id) const {
  const auto found = known_.find(id);
  return found == known_.end() ? nullptr : &found->second;
}

std::string SessionTable::IdOfRequest(const std::string& request_id) const {
  const auto found = session_of_request_.find(request_id);
  return found == session_of_request_.end() ? "" : found->second;
}

SessionEntry* SessionTable::FindRequest(const std::string& request_id) {
  return Find(IdOfRequest(request_id));
}

SessionTable::PendingSessionPtr SessionTable::FindMaking(const std::string& id) const {
  const auto found =
      std::find_if(makings_.begin(), makings_.end(),
                   [&id](const PendingSessionPtr& making) { return making->id == id; });
  return found == makings_.end() ? nullptr : *found;
}

SessionTable::PendingSessionPtr SessionTable::FindMakingOfRequest(
    const std::string& request_id) const {
  const auto found = std::find_if(makings_.begin(), makings_.end(),
                                  [&request_id](const PendingSessionPtr& making) {
                                    return making->key.request_id == request_id;
                                  });
  return found == makings_.end() ? nullptr : *found;
}

void SessionTable::Add(const std::string& id, SessionEntry known) {
  if (!known.key.request_id.empty()) session_of_request_[known.key.request_id] = id;
  known_.emplace(id, std::move(known));
}

std::optional<SessionEntry> SessionTable::Take(const std::string& id) {
  auto node = known_.extract(id);
  if (node.empty()) return std::nullopt;
  session_of_request_.erase(node.mapped().key.request_id);
  ending_.emplace(id, node.mapped().mesh_sha256);
  return std::move(node.mapped());
}

SessionTable::PendingSessionPtr SessionTable::StartMaking(std::string id, RequestKey key,
                                                          std::string owner,
                                                          std::string mesh_sha256, bool restores,
                                                          SessionWaiter waiter) {
  makings_.push_back(
      std::make_shared<PendingSession>(PendingSession{.id = std::move(id),
                                                      .key = std::move(key),
                                                      .owner = std::move(owner),
                                                      .mesh_sha256 = std::move(mesh_sha256),
                                                      .restores = restores,
                                                      .waiters = {std::move(waiter)}}));
  return makings_.back();
}

std::vector<SessionWaiter> SessionTable::EndMaking(const PendingSessionPtr& making) {
  makings_.erase(std::find(makings_.begin(), makings_.end(), making));
  return std::move(making->waiters);
}

std::vector<SessionWaiter> SessionTable::TakeWaiters(const SessionWaiter::CancelFlag& cancelled) {
  std::vector<SessionWaiter> taken;
  for (const PendingSessionPtr& making : makings_) {
    std::vector<SessionWaiter>& waiters = making->waiters;
    const auto first = std::stable_partition(
        waiters.begin(), waiters.end(),
        [&cancelled](const SessionWaiter& waiter) { return waiter.cancelled != cancelled; });
    std::move(first, waiters.end(), std::back_inserter(taken));
    waiters.erase(first, waiters.end());
  }
  return taken;
}

std::string SessionTable::LeastRecentlyUsed(Clock::TimePoint before,
                                            const std::optional<std::string>& owner) const {
  std::string oldest;
  for (const auto& [id, known] : known_) {
    if (known.session == nullptr || known.session->making()) continue;
    if (owner.has_value() && known.owner != *owner) continue;
    if (const Clock::TimePoint used = known.session->last_used(); used < before) {
      before = used;
      oldest = id;
    }
  }
  return oldest;
}

int64_t SessionTable::BytesUnusedSince(Clock::TimePoint before) const {
  int64_t bytes = 0;
  std::map<std::shared_ptr<const SharedPreparation>, bool> is_used;
  for (const auto& [id, known] : known_) {
    if (known.session == nullptr) continue;
    const bool used = known.session->making() || known.session->last_used() >= before;
    if (!used) bytes += known.session->own_bytes();
    is_used[known.session->shared_preparation()] |= used;
  }
  for (const auto& [shared, used] : is_used) {
    if (!used && shared != nullptr) bytes += shared->bytes_held();
  }
  return bytes;
}

int SessionTable::CountOf(const std::string& owner) const {
  const auto known = std::count_if(known_.begin(), known_.end(),
                                   [&](const auto& entry) { return entry.second.owner == owner; });
  const auto made = std::count_if(
      makings_.begin(), makings_.end(),
      [&](const PendingSessionPtr& making) { return making->owner == owner && !making->restores; });
  return static_cast<int>(known + made);
}

std::vector<std::string> SessionTable::UnusedSince(Clock::TimePoint until) const {
  std::vector<std::string> unused;
  for (const auto& [id, known] : known_) {
    if (IsUnused(id, known, until)) unused.push_back(id);
  }
  return unused;
}

bool SessionTable::IsUnusedSince(const std::string& id, Clock::TimePoint until) const {
  const SessionEntry* known = Find(id);
  return known != nullptr && IsUnused(id, *known, until);
}

bool SessionTable::IsUnused(const std::string& id, const SessionEntry& known,
                            Clock::TimePoint until) const {
  const Clock::TimePoint used =
      known.session == nullptr ? known.last_used : known.session->last_used();
  return used <= until && FindMaking(id) == nullptr;
}

bool SessionTable::IsInUse(const std::string& id, const SessionEntry& known,
                           Clock::TimePoint since) const {
  const std::shared_ptr<Session>& session = known.session;
  // The table's own reference is one.
  if (session != nullptr && session.use_count() > 1) return true;
  return (session != nullptr ? session->last_used() : known.last_used) > since ||
         FindMaking(id) != nullptr ||
         std::any_of(known.evicted.begin(), known.evicted.end(),
                     [](const auto& evicted) { return !evicted.expired(); });
}

bool SessionTable::IsInUse(const std::string& id, Clock::TimePoint since) const {
  const SessionEntry* known = Find(id);
  return known != nullptr && IsInUse(id, *known, since);
}

std::vector<std::string> SessionTable::InUse(Clock::TimePoint since) const {
  std::vector<std::string> in_use;
  for (const auto& [id, known] : known_) {
    if (IsInUse(id, known, since)) in_use.push_back(id);
  }
  return in_use;
}

int SessionTable::CountMadeFrom(const std::string& mesh_sha256) const {
  const auto ending =
      std::count_if(ending_.begin(), ending_.end(),
                    [&mesh_sha256](const auto& entry) { return entry.second == mesh_sha256; });
  const auto known = std::count_if(known_.begin(), known_.end(), [&mesh_sha256](const auto& entry) {
    return entry.second.mesh_sha256 == mesh_sha256;
  });
  const auto new_ones = std::count_if(
      makings_.begin(), makings_.end(), [&mesh_sha256](const PendingSessionPtr& making) {
        return !making->restores && making->mesh_sha256 == mesh_sha256;
      });
  return static_cast<int>(known + new_ones + ending);
}

std::vector<std::shared_ptr<Session>> SessionTable::Loaded() const {
  std::vector<std::shared_ptr<Session>> loaded;
  for (const auto& [id, known] : known_) {
    if (known.session != nullptr) loaded.push_back(known.session);
  }
  return loaded;
}

size_t SessionTable::num_loaded_in_table() const {
  return static_cast<size_t>(std::count_if(known_.begin(), known_.end(), [](const auto& entry) {
    return entry.second.session != nullptr;
  }));
}

}  // namespace tissueform
