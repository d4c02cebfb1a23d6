// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/mutex.h"
#include "server/session/session_registry.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"
#include "tests/testing/shared_sessions.h"

namespace tissueform::testing {

// A server of several, as far as its sessions go: calls wait for their answers.
class Node {
 public:
  using Opened = absl::StatusOr<std::shared_ptr<Session>>;

  Node(SharedSessions* shared, const std::string& name)
      : ownership(shared, name),
        store_(shared, name),
        registry(limits_, &budget_, pool_.get(), &store_, &catalog_, &clock, &ownership) {
    registry.table().set_observer([this](const std::string& id, SessionEvent event) {
      MutexLock lock(mutex_);
      if (event == SessionEvent::kMoved) moved_.push_back(id);
    });
    bar_ = Store(SampleMesh(Bar({1, 1, 2})), &catalog_);
  }
  ~Node() {
    registry.Stop();
    pool_.reset();
  }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  Opened Create(const std::string& id, const std::string& request_id = "") {
    SessionRecord record = BarRecord(*bar_);
    record.id = id;
    record.request_id = request_id;
    return Wait<Opened>(
        [&](const auto& done) { registry.loader().Create(record, bar_, flag_, done); });
  }
  // Callers that wait for an answer stop waiting.
  void Cancel() { registry.loader().CancelWait(flag_); }
  Opened Open(const std::string& id) {
    return Wait<Opened>([&](const auto& done) { registry.loader().Open(id, flag_, done); });
  }
  absl::Status Commit(const std::shared_ptr<Session>& session, double z) {
    HandlePose pose;
    pose.translation_mm.z() = z;
    return Wait<absl::Status>(
        [&](const auto& done) { registry.sync().CommitPoses(session, {pose}, done); });
  }
  absl::Status Update(const std::string& id) {
    const auto change = [](SessionRecord record, const StoredMesh& /*mesh*/) {
      record.project += "x";
      return record;
    };
    using View = absl::StatusOr<SessionView>;
    return Wait<View>(
               [&](const auto& done) { registry.loader().Update(id, "", change, flag_, done); })
        .status();
  }
  absl::Status Delete(const std::string& id) {
    return Wait<absl::Status>([&](const auto& done) { registry.sync().Delete(id, done); });
  }
  absl::StatusOr<SessionView> Look(const std::string& id) {
    return Wait<absl::StatusOr<SessionView>>(
        [&](const auto& done) { registry.sync().Look(id, done); });
  }
  int EvictAll() {
    clock.Advance(2 * SessionTable::kInUse);
    return registry.table().Evict([] { return false; });
  }
  // Until workers have let go of what they have answered with, and what was given back by that is.
  void Settle() {
    for (const Lane lane :
         {Lane::kSolves, Lane::kBatch, Lane::kStore, Lane::kLeases, Lane::kStore, Lane::kLeases}) {
      std::promise<void> done;
      pool_->Post(lane, [&done] { done.set_value(); });
      done.get_future().wait();
    }
  }
  // The worker of this lane waits until the promise is kept, or gone.
  std::promise<void> HoldUp(Lane lane) {
    std::promise<void> go;
    pool_->Post(lane, [gone = go.get_future().share()] { gone.wait(); });
    return go;
  }
  // How often this session was reported to have moved.
  int CountMoved(const std::string& id) {
    MutexLock lock(mutex_);
    return static_cast<int>(std::count(moved_.begin(), moved_.end(), id));
  }
  int64_t reserved_bytes() const { return budget_.reserved_bytes(); }
  WorkerPool& pool() { return *pool_; }

  FakeClock clock;
  FakeOwnership ownership;

 private:
  template <typename Result>
  static Result Wait(const std::function<void(const std::function<void(Result)>&)>& call) {
    auto answer = std::make_shared<std::promise<Result>>();
    call([answer](Result result) { answer->set_value(std::move(result)); });
    return answer->get_future().get();
  }

  const ServiceLimits limits_;
  MemoryBudget budget_{64 << 20};
  MeshCatalog catalog_{limits_, &budget_, nullptr, &clock};
  SharedSessionStore store_;
  const SessionLoader::CancelFlag flag_ = std::make_shared<std::atomic<bool>>(false);
  std::unique_ptr<WorkerPool> pool_ = std::make_unique<WorkerPool>(1);
  std::shared_ptr<const StoredMesh> bar_;

  Mutex mutex_;
  std::vector<std::string> moved_ ABSL_GUARDED_BY(mutex_);

 public:
  SessionRegistry registry;
};

}  // namespace tissueform::testing
