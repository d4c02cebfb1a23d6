// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/cancellation.h"
#include "core/constraints/constraint_set.h"
#include "core/constraints/handle_pose.h"
#include "core/deformation/create_deformer.h"
#include "core/deformation/deformer.h"
#include "server/session/clock.h"
#include "server/session/memory_budget.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_models.h"
#include "server/session/worker_pool.h"
#include "server/store/session_record.h"

namespace tissueform {

// An answer at chosen vertices from prepared columns.
struct PreparedAnswer {
  FloatPositions positions;
  SolveSummary summary;
};

// A mesh prepared for poses. Lives on its strand: what is marked so runs there and nowhere else;
// everything else is constant and may be read from any thread.
class Session {
 public:
  // Factorises: call it on a worker. `mesh` is the one that the record names. `budget`, `pool` and
  // `clock` must outlive the session.
  //
  // Errors: InvalidArgument (regions, stiffness), FailedPrecondition (not positive definite),
  // ResourceExhausted (no room), Cancelled.
  static absl::StatusOr<std::shared_ptr<Session>> Create(SessionRecord record,
                                                         std::shared_ptr<const StoredMesh> mesh,
                                                         MemoryBudget* budget, WorkerPool* pool,
                                                         const Clock* clock,
                                                         const Cancellation& cancellation);

  const std::string& id() const { return id_; }
  const StoredMesh& mesh() const { return *mesh_; }
  const ConstraintSet& constraints() const { return constraints_; }
  DeformationModel model() const { return model_; }
  double poisson_ratio() const { return poisson_ratio_; }
  const GradientFieldOptions& gradient_field() const { return gradient_field_; }
  const PreparationSummary& preparation() const { return preparation_; }  // of its own model
  // Grows when another model or prepared answers are first asked for.
  int64_t bytes_held() const { return bytes_held_; }

  Strand& strand() { return strand_; }

  // On the strand only. Makes another model than the session's own ready. What exists is shared and
  // not factorised again.
  //
  // Errors: those of SessionModels::Prepare, NotFound (the session was closed).
  absl::Status PrepareModel(DeformationModel model, const Cancellation& cancellation);
  absl::StatusOr<VertexResponse*> PrepareResponse(const ResponseRequest& request,
                                                  const Cancellation& cancellation);

  // On the strand only. `poses` has one entry per handle, in the order of the constraints.
  //
  // Errors: InvalidArgument (a pose that is not legal), NotFound (the session was closed), those of
  // PrepareModel.
  absl::StatusOr<Deformation> Deform(DeformationModel model, absl::Span<const HandlePose> poses,
                                     const DeformControl& control);

  // On the strand only. The same from prepared answers; empty when they do not cover the poses: use
  // Deform then.
  absl::StatusOr<std::optional<PreparedAnswer>> Respond(const ResponseRequest& request,
                                                        absl::Span<const HandlePose> poses);

  // On the strand only. Gives the memory back; later calls of Deform fail.
  void Close();

  // Any thread. When somebody last did something with the session.
  void Touch() { last_used_ = clock_->Now(); }
  Clock::TimePoint last_used() const { return last_used_; }

 private:
  Session(const SessionRecord& record, std::shared_ptr<const StoredMesh> mesh,
          ConstraintSet constraints, WorkerPool* pool, const Clock* clock);

  absl::Status Prepare(const Eigen::VectorXd& stiffness, MemoryBudget* budget,
                       const Cancellation& cancellation);
  absl::Status CheckOpen() const;

  // Constant after Create.
  const Clock* const clock_;
  const std::string id_;
  const std::shared_ptr<const StoredMesh> mesh_;
  const ConstraintSet constraints_;
  const DeformationModel model_;
  const double poisson_ratio_;
  const GradientFieldOptions gradient_field_;
  PreparationSummary preparation_;

  // Self-synchronised.
  Strand strand_;
  std::atomic<int64_t> bytes_held_ = 0;
  std::atomic<Clock::TimePoint> last_used_;

  // The strand's.
  std::unique_ptr<SessionModels> models_;  // null once closed
};

}  // namespace tissueform
