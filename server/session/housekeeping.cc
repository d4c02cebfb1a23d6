// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/housekeeping.h"

#include <algorithm>
#include <functional>
#include <future>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "spdlog/spdlog.h"

namespace tissueform {
namespace {

constexpr int64_t kDaySeconds = 24 * 3600;
// A clock that is put right is off by more than what one that is kept right drifts.
constexpr int64_t kSetForwardSeconds = 600;
constexpr int kPageSize = 1000;

// The answer of a call that gives it to a callback.
template <typename Result>
Result Await(const std::function<void(std::function<void(Result)>)>& call) {
  std::promise<Result> answer;
  call([&answer](Result result) { answer.set_value(std::move(result)); });
  return answer.get_future().get();
}

// Without the message, which names files.
void WarnUnlessOk(const absl::Status& status, const char* what) {
  if (status.ok()) return;
  spdlog::warn("housekeeping: {}: {}; retried later", what,
               absl::StatusCodeToString(status.code()));
}

}  // namespace

Housekeeping::Housekeeping(Options options, Stores* stores, SessionRegistry* registry,
                           MeshCatalog* catalog)
    : options_(std::move(options)),
      stores_(stores),
      registry_(registry),
      catalog_(catalog),
      started_(options_.clock->Now()),
      started_s_(NowS()),
      started_machine_s_(MachineS()),
      written_until_(started_) {}

void Housekeeping::Start() {
  written_until_ = started_ = options_.clock->Now();
  started_s_ = NowS();
  started_machine_s_ = MachineS();
  thread_ = std::thread([this] { Work(); });
}

void Housekeeping::Stop() {
  if (!thread_.joinable()) return;
  {
    MutexLock lock(mutex_);
    stopping_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
  WriteUse();
}

void Housekeeping::Work() {
  MutexLock lock(mutex_);
  auto next = std::chrono::steady_clock::now() + options_.interval;
  while (!stopping_) {
    if (changed_.WaitUntil(mutex_, next)) continue;
    mutex_.Unlock();
    RunOnce();
    mutex_.Lock();
    next = std::chrono::steady_clock::now() + options_.interval;
  }
}

Housekeeping::Removed Housekeeping::RunOnce() {
  Removed removed;
  if (!WriteUse()) return removed;
  const auto passed =
      std::chrono::duration_cast<std::chrono::seconds>(written_until_ - started_).count();
  // The machine's time, but never ahead of what has passed since the start.
  const int64_t now_s = started_s_ + passed + std::min<int64_t>(offset_s_, 0);
  // Those are files of this machine.
  const int64_t machine_now_s = std::min(MachineS(), started_machine_s_ + passed);
  removed.uploads = RemoveUploads(machine_now_s - options_.partial_uploads.count());
  if (options_.retention_days > 0) {
    const int64_t before_s = now_s - options_.retention_days * kDaySeconds;
    removed.sessions = RemoveSessions(before_s);
    Claimed claimed;
    if (RemovePredictions(before_s, &claimed, &removed.predictions)) {
      removed.meshes = RemoveMeshes(before_s, claimed.meshes);
      removed.cases = RemoveCases(before_s, claimed.cases);
    }
  }
  if (options_.export_retention_days > 0) {
    removed.exports = RemoveExports(now_s - options_.export_retention_days * kDaySeconds);
  }
  if (removed.sessions + removed.predictions + removed.meshes + removed.uploads + removed.cases +
          removed.exports >
      0) {
    spdlog::info(
        "deleted by retention: {} sessions, {} predictions, {} meshes, {} uploads, {} cases, {} "
        "exports",
        removed.sessions, removed.predictions, removed.meshes, removed.uploads, removed.cases,
        removed.exports);
  }
  return removed;
}

bool Housekeeping::WriteUse() {
  const absl::Status asked = stores_->AskTime();
  WarnUnlessOk(asked, "the store's time is unknown");
  if (!asked.ok()) return false;
  const Clock::TimePoint now = options_.clock->Now();
  const int64_t unix_s = NowS();
  const int64_t offset_s = unix_s - started_s_ -
                           std::chrono::duration_cast<std::chrono::seconds>(now - started_).count();
  // A clock that was behind has been put right: what was used before that has a time that is too
  // early.
  const bool set_forward = offset_s > offset_s_ + kSetForwardSeconds;
  const Clock::TimePoint since = set_forward ? started_ : written_until_;

  const SessionTable::Use use = registry_->table().UsedSince(since);
  std::vector<std::string> meshes = catalog_->UsedSince(since);
  meshes.insert(meshes.end(), use.meshes.begin(), use.meshes.end());
  absl::Status status = stores_->meshes().Touch(meshes, unix_s);
  if (status.ok()) {
    status = Await<absl::Status>([&](std::function<void(absl::Status)> done) {
      stores_->sessions().Touch(use.sessions, unix_s, std::move(done));
    });
  }
  WarnUnlessOk(status, "times of use are not written");
  if (!status.ok()) return false;
  written_until_ = now;
  offset_s_ = offset_s;
  return true;
}

int Housekeeping::RemoveUploads(int64_t before_s) {
  const absl::StatusOr<int> removed = stores_->uploads().RemoveOlderThan(before_s);
  WarnUnlessOk(removed.status(), "interrupted uploads remain");
  return removed.value_or(0);
}

int Housekeeping::RemoveSessions(int64_t before_s) {
  const auto page = Await<absl::StatusOr<SessionStore::Page>>(
      [&](auto done) { stores_->sessions().ListUnused(before_s, kMaxOfARound, std::move(done)); });
  WarnUnlessOk(page.status(), "unused sessions remain");
  if (!page.ok()) return 0;
  std::vector<std::string> ids;
  for (const SessionRecord& record : page->records) ids.push_back(record.id);
  return registry_->sync().RemoveUnused(ids, written_until_);
}

bool Housekeeping::RemovePredictions(int64_t before_s, Claimed* claimed, int* removed) {
  PredictionStore& store = stores_->predictions();
  PredictionStore::ListRequest request{
      .owner = std::nullopt, .session = std::nullopt, .after = "", .limit = kPageSize};
  do {
    absl::StatusOr<PredictionStore::Page> page = store.List(request);
    WarnUnlessOk(page.status(), "old predictions remain");
    if (!page.ok()) return false;
    for (const PredictionRecord& record : page->records) {
      const bool old = record.created_s < before_s && !registry_->table().Knows(record.session);
      if (old && *removed < kMaxOfARound && store.Delete(record.id).ok()) {
        ++*removed;
      } else {
        claimed->meshes.insert(record.mesh_sha256);
        claimed->cases.insert(record.case_sha256);
      }
    }
    request.after = std::move(page->next);
  } while (!request.after.empty());
  return true;
}

int Housekeeping::RemoveMeshes(int64_t before_s, const std::set<std::string>& of_predictions) {
  if (!catalog_->keeps_meshes()) return 0;
  // In use by their sessions and predictions, they would stand in the way of others.
  int removed = 0;
  const absl::StatusOr<std::vector<MeshRecord>> unused =
      stores_->meshes().ListUnused(before_s, kPageSize);
  WarnUnlessOk(unused.status(), "unused meshes remain");
  if (!unused.ok()) return 0;
  std::vector<std::string> of_unknown_age;
  for (const MeshRecord& record : *unused) {
    if (removed == kMaxOfARound) break;
    if (of_predictions.contains(record.sha256) ||
        registry_->table().CountMadeFrom(record.sha256) > 0) {
      continue;
    }
    // Servers before this one wrote no time: their meshes count from now on.
    if (record.last_used_s == 0) {
      of_unknown_age.push_back(record.sha256);
      continue;
    }
    const absl::StatusOr<bool> gone = catalog_->RemoveUnused(record.sha256, written_until_);
    WarnUnlessOk(gone.status(), "an unused mesh remains");
    removed += gone.ok() && *gone ? 1 : 0;
  }
  WarnUnlessOk(stores_->meshes().Touch(of_unknown_age, NowS()), "times of use are not written");
  return removed;
}

int Housekeeping::RemoveExports(int64_t before_s) {
  if (!options_.remove_exports) return 0;
  const absl::StatusOr<int> removed = options_.remove_exports(before_s, kMaxOfARound);
  WarnUnlessOk(removed.status(), "unchanged exports remain");
  return removed.value_or(0);
}

int Housekeeping::RemoveCases(int64_t before_s, const std::set<std::string>& of_predictions) {
  const absl::StatusOr<std::vector<CaseKey>> removed =
      stores_->cases().RemoveUnused(before_s, of_predictions, kMaxOfARound);
  WarnUnlessOk(removed.status(), "unused cases remain");
  return removed.ok() ? static_cast<int>(removed->size()) : 0;
}

}  // namespace tissueform
