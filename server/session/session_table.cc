// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_table.h"

#include <algorithm>

#include "spdlog/spdlog.h"

#include "server/session/quotas.h"
#include "server/session/session_errors.h"

namespace tissueform {

RequestKey RequestKeyOf(const SessionRecord& record) {
  if (record.request_id.empty() || record.owner.empty()) {
    return {record.request_id, record.request_fingerprint};
  }
  return {record.owner + "\n" + record.request_id, record.request_fingerprint};
}

absl::StatusOr<std::shared_ptr<Session>> SessionTable::Find(const std::string& id) {
  MutexLock lock(mutex_);
  const Entry* entry = FindEntry(id);
  if (entry == nullptr || entry->session == nullptr || !entry->session->CheckHeld().ok()) {
    return NoSuchSession(id);
  }
  entry->session->Touch();  // under the lock: from now on it is not evicted
  return entry->session;
}

std::shared_ptr<Session> SessionTable::Peek(const std::string& id) const {
  MutexLock lock(mutex_);
  const Entry* entry = FindEntry(id);
  return entry == nullptr ? nullptr : entry->session;
}

bool SessionTable::Knows(const std::string& id) const {
  MutexLock lock(mutex_);
  return entries_.contains(id);
}

std::vector<std::shared_ptr<Session>> SessionTable::Loaded() const {
  std::vector<std::shared_ptr<Session>> loaded;
  MutexLock lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    if (entry.session != nullptr) loaded.push_back(entry.session);
  }
  return loaded;
}

int SessionTable::size() const {
  MutexLock lock(mutex_);
  return CountLoaded();
}

std::vector<std::string> SessionTable::KnownIds() const {
  MutexLock lock(mutex_);
  std::vector<std::string> ids;
  ids.reserve(entries_.size());
  for (const auto& [id, entry] : entries_) ids.push_back(id);
  return ids;
}

std::string SessionTable::OwnerOf(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  return found == entries_.end() ? "" : found->second.owner;
}

int SessionTable::CountKnown() const {
  MutexLock lock(mutex_);
  return static_cast<int>(entries_.size());
}

int SessionTable::CountMadeFrom(const std::string& mesh_sha256) const {
  MutexLock lock(mutex_);
  return CountOf(mesh_sha256);
}

SessionTable::Use SessionTable::UsedSince(Clock::TimePoint since) const {
  Use use;
  std::set<std::string> meshes;
  MutexLock lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    if (IsUnusedEntry(id, entry, since, Streams::kCount)) continue;
    use.sessions.push_back(id);
    meshes.insert(entry.mesh_sha256);
  }
  use.meshes.assign(meshes.begin(), meshes.end());
  return use;
}

int SessionTable::Evict(const std::function<bool()>& enough,
                        const std::optional<std::string>& owner) {
  int count = 0;
  while (!enough()) {
    const std::shared_ptr<Session> evicted = EvictOldest(owner);
    if (evicted == nullptr) break;
    observer_(evicted->id(), SessionEvent::kEvicted);
    // At once, although streams may hold it: nothing is solved in a session that is not in use.
    evicted->Close(Session::CloseReason::kEvicted);
    ++count;
  }
  if (count > 0) spdlog::info("{} unused sessions were evicted from memory", count);
  return count;
}

// A session that is being loaded is not in the table yet, so it cannot be evicted before its
// callers have it. Its place counts, so it finds room.
std::shared_ptr<Session> SessionTable::EvictOldest(const std::optional<std::string>& owner) {
  MutexLock lock(mutex_);
  Entry* oldest = LeastRecentlyUsed(clock_->Now() - kInUse, owner);
  if (oldest == nullptr) return nullptr;
  std::shared_ptr<Session> evicted = Unload(oldest);
  std::erase_if(oldest->evicted, [](const auto& earlier) { return earlier.expired(); });
  oldest->evicted.push_back(evicted);
  return evicted;
}

SessionTable::Entry* SessionTable::LeastRecentlyUsed(Clock::TimePoint before,
                                                     const std::optional<std::string>& owner) {
  Entry* oldest = nullptr;
  for (auto& [id, entry] : entries_) {
    // What is being made for a session would hold its memory until that ends.
    if (entry.session == nullptr || entry.session->making()) continue;
    if (owner.has_value() && entry.owner != *owner) continue;
    if (const Clock::TimePoint used = entry.session->last_used(); used < before) {
      before = used;
      oldest = &entry;
    }
  }
  return oldest;
}

// What several sessions share goes with the last of them.
int64_t SessionTable::EvictableBytes() const {
  int64_t bytes = 0;
  std::map<std::shared_ptr<const SharedPreparation>, bool> is_used;
  const Clock::TimePoint before = clock_->Now() - kInUse;
  MutexLock lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    if (entry.session == nullptr) continue;
    const bool used = entry.session->making() || entry.session->last_used() >= before;
    if (!used) bytes += entry.session->own_bytes();
    is_used[entry.session->shared_preparation()] |= used;
  }
  for (const auto& [shared, used] : is_used) {
    if (!used && shared != nullptr) bytes += shared->bytes_held();
  }
  return bytes;
}

// Nothing leaves memory while there is room. Others may come while this evicts, so Begin checks
// once more whether there is room.
bool SessionTable::MakeRoom() {
  const auto has_room = [this] {
    MutexLock lock(mutex_);
    return !Full();
  };
  if (has_room()) return true;
  Evict(has_room);
  return has_room();
}

// The mesh leaves between two sections under the lock. BeginCreation reads leaving_meshes_ and
// gives the place under the same lock: so either this counts the place, or the creation is refused.
absl::Status SessionTable::RemoveMesh(const std::string& sha256) {
  // Sessions in memory keep their meshes, which could not be read again.
  if (!catalog_->keeps_meshes()) return catalog_->Remove(sha256);
  {
    MutexLock lock(mutex_);
    const int sessions = CountOf(sha256);
    if (sessions > 0) return MeshInUse(sessions);
    leaving_meshes_.insert(sha256);
  }
  absl::Status removed = catalog_->Remove(sha256);
  MutexLock lock(mutex_);
  leaving_meshes_.erase(leaving_meshes_.find(sha256));
  return removed;
}

void SessionTable::Lost(const std::string& id) {
  std::shared_ptr<Session> lost;
  {
    MutexLock lock(mutex_);
    if (Entry* entry = FindEntry(id); entry != nullptr) lost = UnloadIfLost(entry);
  }
  if (lost != nullptr) {
    CloseLost(lost);
  } else if (!leases_->Holds(id)) {
    observer_(id, SessionEvent::kMoved);  // watches hold it without a session in memory
  }
}

void SessionTable::CloseLost(const std::shared_ptr<Session>& lost) const {
  if (lost == nullptr) return;
  lost->Close(Session::CloseReason::kMoved);
  observer_(lost->id(), SessionEvent::kMoved);
}

// All checks and the place under one lock: of two creations for the last place, of the server or of
// the owner, or for one id, one is refused.
absl::Status SessionTable::BeginCreation(const SessionRecord& record) {
  MutexLock lock(mutex_);
  absl::Status refusal;
  if (entries_.contains(record.id) || places_.contains(record.id)) {
    refusal = TakenId(record.id);
  } else if (ending_.contains(record.id)) {
    refusal = EndingId(record.id);
  } else if (entries_.size() >= static_cast<size_t>(limits_.max_stored_sessions)) {
    refusal = TooManySessions(limits_.max_stored_sessions, "keeps",
                              "; delete one or raise --max-stored-sessions");
  }
  if (refusal.ok()) refusal = CheckQuota(record.owner);
  if (refusal.ok()) refusal = CheckMesh(record.mesh_sha256);
  if (refusal.ok()) refusal = CheckRoom();
  if (!refusal.ok()) return refusal;
  Place place = {.creates = true,
                 .key = RequestKeyOf(record),
                 .owner = record.owner,
                 .mesh_sha256 = record.mesh_sha256};
  if (!place.key.request_id.empty()) requests_[place.key.request_id] = record.id;
  places_.emplace(record.id, std::move(place));
  return absl::OkStatus();
}

void SessionTable::FinishCreation(const std::string& id, const std::shared_ptr<Session>& created,
                                  int claims) {
  MutexLock lock(mutex_);
  Place place = std::move(places_.extract(id).mapped());
  if (created != nullptr && claims > 0) {
    Add(id, {.session = created,
             .key = std::move(place.key),
             .owner = std::move(place.owner),
             .mesh_sha256 = std::move(place.mesh_sha256),
             .claims = claims});
    return;
  }
  ForgetRequest(place.key, id);
  if (created != nullptr) ending_.emplace(id, std::move(place.mesh_sha256));
}

SessionTable::Found SessionTable::BeginLoading(const std::string& id, bool claims) {
  MutexLock lock(mutex_);
  Entry* entry = FindEntry(id);
  if (entry == nullptr) return {.refusal = NoSuchSession(id)};
  Found found = {.lost = UnloadIfLost(entry)};
  if (entry->session != nullptr) {
    entry->session->Touch();
    entry->claims += claims ? 1 : 0;
    found.session = entry->session;
  } else if (!places_.contains(id)) {
    found.refusal = CheckRoom();
    if (found.refusal.ok()) places_.emplace(id, Place{.version = entry->version});
  }
  return found;
}

// Under one lock, so that what is put into the table is what the table expects now:
// - The session was deleted while it was loaded: it does not come back. Its place has kept the id
//   from being created again.
// - It was updated: what was loaded is the session before. The updated one is used if it is in
//   memory; otherwise it is loaded.
// - The lease was lost: the table hears of it (Lost) only after CheckHeld refuses. So either the
//   session is refused here, or Lost finds it in the table.
SessionTable::Found SessionTable::FinishLoading(
    const std::string& id, const absl::StatusOr<std::shared_ptr<Session>>& loaded, bool wanted,
    int claims) {
  MutexLock lock(mutex_);
  const auto place = places_.find(id);
  Entry* entry = FindEntry(id);
  Found found = {.refusal = loaded.ok() ? (*loaded)->CheckHeld() : loaded.status()};
  if (entry == nullptr) {
    if (found.refusal.ok()) found.refusal = NoSuchSession(id);
  } else if (found.lost = UnloadIfLost(entry); entry->session != nullptr) {
    found.refusal = absl::OkStatus();
  } else if (entry->version != place->second.version) {
    found.refusal = absl::CancelledError("the session was updated");
    place->second.version = entry->version;
  }
  found.loads_again = entry != nullptr && absl::IsCancelled(found.refusal) && wanted;
  if (found.loads_again) return found;
  places_.erase(place);
  if (!found.refusal.ok()) return found;
  if (entry->session == nullptr) entry->session = *loaded;
  found.session = entry->session;
  entry->mesh.reset();
  entry->claims += claims;
  return found;
}

absl::Status SessionTable::CheckUpdate(const std::string& id) const {
  MutexLock lock(mutex_);
  const Entry* entry = FindEntry(id);
  if (entry == nullptr) return NoSuchSession(id);
  return entry->session == nullptr ? CheckRoom() : absl::OkStatus();
}

std::optional<SessionTable::EarlierRequest> SessionTable::FindRequest(
    const std::string& request_id) const {
  MutexLock lock(mutex_);
  const auto found = requests_.find(request_id);
  if (found == requests_.end()) return std::nullopt;
  const Entry* entry = FindEntry(found->second);
  return EarlierRequest{found->second,
                        entry != nullptr ? entry->key : places_.at(found->second).key};
}

SessionTable::Taken SessionTable::Take(const std::string& id) {
  MutexLock lock(mutex_);
  return TakeEntry(id);
}

bool SessionTable::TakeAbandoned(const std::shared_ptr<Session>& session) {
  MutexLock lock(mutex_);
  Entry* entry = FindEntry(session->id());
  // Clients choose ids: another session may have it by now.
  if (entry == nullptr || entry->session != session || --entry->claims > 0) return false;
  TakeEntry(session->id());
  return true;
}

SessionTable::Taken SessionTable::TakeGone(const std::string& id) {
  MutexLock lock(mutex_);
  if (places_.contains(id)) return std::nullopt;
  Taken taken = TakeEntry(id);
  if (taken.has_value()) ending_.erase(id);
  return taken;
}

void SessionTable::Ended(const std::string& id) {
  MutexLock lock(mutex_);
  ending_.erase(id);
}

std::vector<std::string> SessionTable::Unused(Clock::TimePoint since) const {
  std::vector<std::string> unused;
  MutexLock lock(mutex_);
  for (const auto& [id, entry] : entries_) {
    if (IsUnusedEntry(id, entry, since, Streams::kIgnored)) unused.push_back(id);
  }
  return unused;
}

bool SessionTable::IsUnused(const std::string& id, Clock::TimePoint since, Streams streams) const {
  MutexLock lock(mutex_);
  const Entry* entry = FindEntry(id);
  return entry != nullptr && IsUnusedEntry(id, *entry, since, streams);
}

SessionTable::Taken SessionTable::TakeUnused(const std::string& id, Clock::TimePoint since,
                                             Streams streams) {
  MutexLock lock(mutex_);
  const Entry* entry = FindEntry(id);
  if (entry == nullptr || !IsUnusedEntry(id, *entry, since, streams)) return std::nullopt;
  return TakeEntry(id);
}

void SessionTable::Learn(const SessionRecord& record) {
  MutexLock lock(mutex_);
  if (Entry* entry = FindEntry(record.id); entry != nullptr) {
    if (entry->session != nullptr && entry->session->CheckHeld().ok()) return;
    entry->owner = record.owner;
    entry->mesh_sha256 = record.mesh_sha256;
  } else if (!places_.contains(record.id) && !ending_.contains(record.id)) {
    Add(record.id, {.session = nullptr,
                    .key = RequestKeyOf(record),
                    .owner = record.owner,
                    .mesh_sha256 = record.mesh_sha256,
                    .last_used = clock_->Now()});
  }
}

absl::Status SessionTable::Replace(const SessionView& updated, bool other_handles) {
  std::shared_ptr<Session> before;
  {
    MutexLock lock(mutex_);
    Entry* entry = FindEntry(updated.record.id);
    if (entry == nullptr) return NoSuchSession(updated.record.id);  // it was deleted
    before = std::exchange(entry->session, updated.session);
    entry->mesh.reset();
    ++entry->version;
    if (before != nullptr) entry->evicted.push_back(before);
    // Callers that open it from now on get the new one; streams that hold an earlier one have to
    // know why it closes.
    for (const std::weak_ptr<Session>& earlier : entry->evicted) {
      if (const std::shared_ptr<Session> held = earlier.lock()) held->MarkUpdated(other_handles);
    }
  }
  if (before != nullptr) before->Close(Session::CloseReason::kUpdated);
  return absl::OkStatus();
}

const SessionTable::Entry* SessionTable::FindEntry(const std::string& id) const {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second;
}

SessionTable::Entry* SessionTable::FindEntry(const std::string& id) {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second;
}

void SessionTable::Add(const std::string& id, Entry entry) {
  if (!entry.key.request_id.empty()) requests_[entry.key.request_id] = id;
  entries_.emplace(id, std::move(entry));
}

SessionTable::Taken SessionTable::TakeEntry(const std::string& id) {
  auto node = entries_.extract(id);
  if (node.empty()) return std::nullopt;
  Entry& entry = node.mapped();
  ForgetRequest(entry.key, id);
  ending_.emplace(id, std::move(entry.mesh_sha256));
  return TakenSession{std::move(entry.session), std::move(entry.mesh)};
}

void SessionTable::ForgetRequest(const RequestKey& key, const std::string& id) {
  const auto found = requests_.find(key.request_id);
  if (found != requests_.end() && found->second == id) requests_.erase(found);
}

std::shared_ptr<Session> SessionTable::Unload(Entry* entry) {
  std::shared_ptr<Session> session = std::exchange(entry->session, nullptr);
  entry->last_used = session->last_used();
  if (!catalog_->keeps_meshes()) entry->mesh = session->shared_mesh();
  return session;
}

std::shared_ptr<Session> SessionTable::UnloadIfLost(Entry* entry) {
  if (entry->session == nullptr || entry->session->CheckHeld().ok()) return nullptr;
  return Unload(entry);
}

bool SessionTable::IsUnusedEntry(const std::string& id, const Entry& entry, Clock::TimePoint since,
                                 Streams streams) const {
  const std::shared_ptr<Session>& session = entry.session;
  const Clock::TimePoint used = session == nullptr ? entry.last_used : session->last_used();
  if (used > since || places_.contains(id)) return false;
  if (streams == Streams::kIgnored) return true;
  // The table's own reference is one.
  return (session == nullptr || session.use_count() == 1) &&
         std::all_of(entry.evicted.begin(), entry.evicted.end(),
                     [](const auto& earlier) { return earlier.expired(); });
}

absl::Status SessionTable::CheckQuota(const std::string& owner) const {
  if (max_of_owner_ == 0 || owner.empty()) return absl::OkStatus();
  const auto is_owned = [&owner](const auto& known) { return known.second.owner == owner; };
  // Places of sessions that are loaded have no owner: their entries count.
  if (std::count_if(entries_.begin(), entries_.end(), is_owned) +
          std::count_if(places_.begin(), places_.end(), is_owned) <
      max_of_owner_) {
    return absl::OkStatus();
  }
  constexpr std::chrono::minutes kUntilSomeMayBeGone{1};
  return QuotaExceeded("sessions", "sessions", max_of_owner_, kUntilSomeMayBeGone);
}

// The caller has found the mesh and holds it, so it leaves the catalog by RemoveMesh only.
absl::Status SessionTable::CheckMesh(const std::string& sha256) const {
  if (!catalog_->keeps_meshes()) return absl::OkStatus();
  const bool leaves = leaving_meshes_.contains(sha256);
  return leaves || catalog_->Find(sha256) == nullptr ? NoMeshAnyMore() : absl::OkStatus();
}

absl::Status SessionTable::CheckRoom() const {
  if (!Full()) return absl::OkStatus();
  return TooManySessions(
      limits_.max_sessions, "holds",
      " in memory, and all are in use; try again in a moment, delete one, or raise "
      "--max-sessions");
}

bool SessionTable::Full() const {
  return CountLoaded() + static_cast<int>(places_.size()) >= limits_.max_sessions;
}

int SessionTable::CountLoaded() const {
  return static_cast<int>(std::count_if(entries_.begin(), entries_.end(), [](const auto& known) {
    return known.second.session != nullptr;
  }));
}

int SessionTable::CountOf(const std::string& mesh_sha256) const {
  const auto is_made_from = [&](const auto& known) {
    return known.second.mesh_sha256 == mesh_sha256;
  };
  const auto ends = [&](const auto& ending) { return ending.second == mesh_sha256; };
  return static_cast<int>(std::count_if(entries_.begin(), entries_.end(), is_made_from) +
                          std::count_if(places_.begin(), places_.end(), is_made_from) +
                          std::count_if(ending_.begin(), ending_.end(), ends));
}

}  // namespace tissueform
