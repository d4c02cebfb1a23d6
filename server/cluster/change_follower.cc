// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/cluster/change_follower.h"

#include <algorithm>
#include <chrono>
#include <future>
#include <limits>
#include <set>
#include <utility>
#include <vector>

#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Kind = StoreChange::Kind;

// More than these are one: read everything.
constexpr size_t kMaxWaiting = 10'000;
constexpr int kPageOfAll = 1'000;
constexpr std::chrono::milliseconds kBeforeTryingAgain{500};

template <typename Result, typename Call>
Result WaitForAnswer(Call call) {
  std::promise<Result> answer;
  call([&answer](Result result) { answer.set_value(std::move(result)); });
  return answer.get_future().get();
}

absl::StatusOr<SessionRecord> GetRecord(SessionStore& store, const std::string& id) {
  return WaitForAnswer<absl::StatusOr<SessionRecord>>(
      [&](SessionStore::RecordCallback done) { store.Get(id, std::move(done)); });
}

}  // namespace

absl::StatusOr<std::unique_ptr<ChangeFollower>> ChangeFollower::Start(
    const PostgresOptions& options) {
  std::unique_ptr<ChangeFollower> follower(new ChangeFollower());
  TF_ASSIGN_OR_RETURN(follower->listener_,
                      ChangeListener::Start(options, [raw = follower.get()](const auto& change) {
                        raw->OnRemoteChange(change);
                      }));
  return follower;
}

ChangeFollower::~ChangeFollower() {
  listener_.reset();
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
}

void ChangeFollower::Begin(const ClusterListeners& rooms) {
  rooms_ = rooms;
  thread_ = std::thread([this] { Loop(); });
}

void ChangeFollower::OnRemoteChange(const StoreChange& change) {
  MutexLock lock(mutex_);
  // What waits is read as it is then: once is enough.
  if (std::find(heard_.begin(), heard_.end(), change) != heard_.end()) return;
  if (heard_.size() >= kMaxWaiting) {
    heard_.assign(1, {.kind = Kind::kMissed});
  } else {
    heard_.push_back(change);
  }
  changed_.NotifyAll();
}

bool ChangeFollower::Next(StoreChange* change) {
  MutexLock lock(mutex_);
  while (!ending_ && heard_.empty()) changed_.Wait(mutex_);
  if (ending_) return false;
  *change = std::move(heard_.front());
  heard_.pop_front();
  return true;
}

void ChangeFollower::Loop() {
  StoreChange change;
  while (Next(&change)) {
    if (Apply(change).ok()) continue;
    spdlog::warn("changes by other servers cannot be read; everything is read again later");
    const auto next = std::chrono::steady_clock::now() + kBeforeTryingAgain;
    MutexLock lock(mutex_);
    heard_.assign(1, {.kind = Kind::kMissed});
    while (!ending_ && std::chrono::steady_clock::now() < next) changed_.WaitUntil(mutex_, next);
  }
}

absl::Status ChangeFollower::Apply(const StoreChange& change) {
  switch (change.kind) {
    case Kind::kSessionCreated:
    case Kind::kSessionChanged:
    case Kind::kSessionDeleted:
      return LookAtSession(change.name);
    case Kind::kMeshDeleted:
      return LookAtMesh(change.name);
    case Kind::kExportsChanged:
      return rooms_.exports->ReloadRows();
    case Kind::kMissed:
      return ResyncAll();
  }
  return absl::OkStatus();
}

absl::Status ChangeFollower::LookAtSession(const std::string& id) {
  const absl::StatusOr<SessionRecord> record = GetRecord(rooms_.stores->sessions(), id);
  if (record.ok()) {
    rooms_.sessions->sync().OnChanged(*record);
    return absl::OkStatus();
  }
  if (!absl::IsNotFound(record.status())) return record.status();
  rooms_.sessions->sync().OnDeleted(id);
  return absl::OkStatus();
}

absl::Status ChangeFollower::LookAtMesh(const std::string& sha256) {
  const absl::Status found = rooms_.stores->meshes().Find(sha256).status();
  if (!found.ok() && !absl::IsNotFound(found)) return found;
  if (!found.ok()) rooms_.meshes->Forget(sha256);
  return absl::OkStatus();
}

absl::Status ChangeFollower::ResyncAll() {
  // What comes to be known from here on has come after what is read.
  const std::vector<std::string> known = rooms_.sessions->table().KnownIds();
  const std::vector<std::string> meshes = rooms_.meshes->HeldNames();
  TF_RETURN_IF_ERROR(LookAtAllSessions(known));
  for (const std::string& sha256 : meshes) TF_RETURN_IF_ERROR(LookAtMesh(sha256));
  return rooms_.exports->ReloadRows();
}

absl::Status ChangeFollower::LookAtAllSessions(const std::vector<std::string>& known) {
  std::set<std::string> gone(known.begin(), known.end());
  SessionStore::ListRequest request{.limit = kPageOfAll};
  do {
    TF_ASSIGN_OR_RETURN(
        SessionStore::Page page,
        WaitForAnswer<absl::StatusOr<SessionStore::Page>>([&](SessionStore::PageCallback done) {
          rooms_.stores->sessions().List(request, std::move(done));
        }));
    for (const SessionRecord& record : page.records) {
      gone.erase(record.id);
      rooms_.sessions->sync().OnChanged(record);
    }
    request.after = std::move(page.next);
  } while (!request.after.empty());
  for (const std::string& id : gone) rooms_.sessions->sync().OnDeleted(id);
  return absl::OkStatus();
}

}  // namespace tissueform
