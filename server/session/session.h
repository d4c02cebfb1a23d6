// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/cancellation.h"
#include "core/base/mutex.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/deformer.h"
#include "server/session/clock.h"
#include "server/session/memory_budget.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_lease_table.h"
#include "server/session/shared_preparation.h"
#include "server/session/worker_pool.h"
#include "server/store/session_record.h"

namespace tissueform {

// An answer at chosen vertices from prepared columns.
struct PreparedAnswer {
  FloatPositions positions;
  SolveSummary summary;
  Eigen::VectorXf band_mm;  // of each vertex; empty where it is not known
};

// A stream's claim on prepared answers; empty once its session is closed, so that no stream keeps
// their memory. Thread-safe.
class PreparedAnswersRef {
 public:
  explicit PreparedAnswersRef(std::shared_ptr<const SharedResponse> response)
      : response_(std::move(response)) {}

  // Null when dropped.
  std::shared_ptr<const SharedResponse> Get() const {
    MutexLock lock(mutex_);
    return response_;
  }
  void Drop() {
    MutexLock lock(mutex_);
    response_.reset();
  }

 private:
  mutable Mutex mutex_;
  std::shared_ptr<const SharedResponse> response_ ABSL_GUARDED_BY(mutex_);
};

// A mesh prepared for poses: models of its own on a preparation that it may share.
//
// Two strands: what makes something runs on that of the preparation, in Lane::kBatch; solves run on
// the session's own, so that they do not wait for what is made; answers from prepared columns need
// neither. The rest is constant or may be called from any thread.
class Session {
 public:
  // Factorises unless the preparation has it: call it on preparation->strand(). `mesh` is the one
  // that the record names. `budget`, `pool` and `clock` must outlive the session.
  //
  // Errors: InvalidArgument (regions, stiffness), FailedPrecondition (not positive definite),
  // ResourceExhausted (no room), Cancelled.
  static absl::StatusOr<std::shared_ptr<Session>> Create(
      SessionRecord record, std::shared_ptr<const StoredMesh> mesh,
      std::shared_ptr<SharedPreparation> preparation, MemoryBudget* budget, WorkerPool* pool,
      const Clock* clock, const Cancellation& cancellation);

  const std::string& id() const { return id_; }

  // The lease by which this server holds it; null where its store is its own. Set once, before any
  // code but its creator has it.
  void SetHold(SessionLeaseHandlePtr hold) { hold_ = std::move(hold); }
  const SessionLeaseHandlePtr& hold() const { return hold_; }
  // Under which it is written.
  int64_t epoch() const { return EpochUnder(hold_); }
  // Any thread, under any lock; costs nothing where the store is not shared. What it answers may be
  // sent, and what is written of it kept, only while this is OK. Errors: SESSION_MOVED.
  absl::Status CheckHeld() const { return CheckHold(hold_); }

  const StoredMesh& mesh() const { return *mesh_; }
  const std::shared_ptr<const StoredMesh>& shared_mesh() const { return mesh_; }
  const ConstraintSet& constraints() const { return constraints_; }
  DeformationModel model() const { return options_.model; }
  // Pa for every tet, or the name of a cell array of the mesh.
  const std::variant<double, std::string>& stiffness() const { return stiffness_; }
  // Of lips that are sealed.
  const std::optional<LipEdge>& seal() const { return options_.seal; }
  double poisson_ratio() const { return options_.preparation.poisson_ratio; }
  const GradientFieldOptions& gradient_field() const { return options_.gradient_field; }
  const PreparationSummary& preparation() const { return summary_; }  // of its own model
  // Grow when another model or prepared answers are first asked for. The second is what other
  // sessions may use as well, and is part of the first.
  int64_t bytes_held() const { return own_bytes_ + shared_bytes(); }
  int64_t own_bytes() const { return own_bytes_; }
  int64_t shared_bytes() const;
  // Whose bytes the shared ones are. Null once closed.
  std::shared_ptr<const SharedPreparation> shared_preparation() const;

  // Where solves run, in LaneOf(model).
  Strand& strand() { return strand_; }
  // Where things are made, in Lane::kBatch.
  Strand& making_strand() { return making_strand_; }
  WorkerPool& pool() { return *pool_; }

  // Any thread. A model that is not there yet needs PrepareModel.
  bool HasModel(DeformationModel model) const;
  Lane LaneOf(DeformationModel model) const;

  // On making_strand(). Prepares another model than the session's own. What exists is shared
  // and not factorised again.
  //
  // Errors: those of SharedPreparation::MakeModel and PrepareResponse, NotFound (the session was
  // closed).
  absl::Status PrepareModel(DeformationModel model, const Cancellation& cancellation);
  absl::StatusOr<std::shared_ptr<PreparedAnswersRef>> PrepareResponse(
      const ResponseRequest& request, const Cancellation& cancellation);
  // On making_strand(). SharedPreparation::FindMaterialBand. Errors: those and NotFound.
  absl::StatusOr<Eigen::VectorXf> FindMaterialBand(DeformationModel model,
                                                   const MaterialUncertainty& uncertainty,
                                                   absl::Span<const HandlePose> poses,
                                                   const Positions& deformed,
                                                   const Cancellation& cancellation);

  // On the strand. `poses` has one entry per handle, in the order of the constraints.
  //
  // Errors: InvalidArgument (a pose that is not legal), NotFound (the session was closed, see
  // evicted), Unavailable (it was closed, see moved), FailedPrecondition (a model that was not
  // prepared).
  absl::StatusOr<Deformation> Solve(DeformationModel model, absl::Span<const HandlePose> poses,
                                    const DeformControl& control);

  // Any thread. The same from prepared answers; empty when they do not cover the poses: use Deform
  // then. Errors: NotFound (the session was closed).
  absl::StatusOr<std::optional<PreparedAnswer>> Respond(const PreparedAnswersRef& claim,
                                                        absl::Span<const HandlePose> poses);

  // Any thread. Hears how far the prepared answers are for as long as the result lives; see
  // SharedPreparation::Follow. Null once closed.
  std::shared_ptr<const ProgressFeed::Follower> Follow(const ResponseRequest& request,
                                                       SessionProgressCallback on_progress) const;

  enum class CloseReason { kDeleted, kEvicted, kUpdated, kMoved };

  // Any thread; on the strand where the memory is to be free afterwards even if something is being
  // solved. Gives the memory back; later calls of Deform fail. A preparation for the session that
  // is under way at this moment gives its memory back when it ends.
  void Close(CloseReason reason);
  // Any thread. Closed, but the server still has the session: SessionLoader::Open gives another.
  bool evicted() const { return evicted_; }
  // Any thread. Closed, since this server no longer holds it.
  bool moved() const { return moved_; }
  // Any thread. That other one is made from something else; and its handles are others, so that
  // poses for this one say nothing to it. Stay so.
  bool updated() const { return updated_; }
  bool outdated() const { return outdated_; }
  void MarkUpdated(bool other_handles) {
    updated_ = true;
    if (other_handles) outdated_ = true;
  }
  // Any thread. Whether one of the calls on making_strand() is under way.
  bool making() const { return making_; }

  // Any thread. Records that a client has used the session now.
  void Touch() { last_used_ = clock_->Now(); }
  Clock::TimePoint last_used() const { return last_used_; }

 private:
  // What ends with Close.
  struct Model {
    MemoryReservation reservation;  // of its workspaces; given back after them
    std::shared_ptr<Deformer> deformer;
  };
  struct Models {
    std::shared_ptr<SharedPreparation> preparation;
    MemoryReservation reservation;  // of answers
    std::map<DeformationModel, Model> models;
    std::vector<std::weak_ptr<PreparedAnswersRef>> claims;
  };

  Session(const SessionRecord& record, std::shared_ptr<const StoredMesh> mesh,
          ConstraintSet constraints, const Strand& making_strand, MemoryBudget* budget,
          WorkerPool* pool, const Clock* clock);

  absl::Status Prepare(const Eigen::VectorXd& stiffness,
                       std::shared_ptr<SharedPreparation> preparation,
                       const Cancellation& cancellation);
  // Errors: NotFound once closed.
  absl::StatusOr<std::shared_ptr<SharedPreparation>> OpenPreparation() const;
  // Errors: NotFound once closed.
  ResponseRequest Sealed(ResponseRequest request) const;
  absl::Status Keep(DeformationModel model, Model made);
  absl::Status MakeModel(DeformationModel model, const Cancellation& cancellation);
  absl::Status Closed() const;

  // Constant after Create.
  const Clock* const clock_;
  MemoryBudget* const budget_;
  WorkerPool* const pool_;
  const std::string id_;
  const std::shared_ptr<const StoredMesh> mesh_;
  const ConstraintSet constraints_;
  const std::variant<double, std::string> stiffness_;
  DeformerOptions options_;
  PreparationSummary summary_;
  SessionLeaseHandlePtr hold_;

  // Self-synchronised.
  Strand strand_;
  Strand making_strand_;  // the preparation's
  std::atomic<int64_t> own_bytes_ = 0;
  std::atomic<bool> making_ = false;
  std::atomic<bool> evicted_ = false;
  std::atomic<bool> moved_ = false;
  std::atomic<bool> updated_ = false;
  std::atomic<bool> outdated_ = false;
  std::atomic<Clock::TimePoint> last_used_;

  mutable Mutex mutex_;
  std::optional<Models> models_ ABSL_GUARDED_BY(mutex_);  // empty once closed
};

}  // namespace tissueform
