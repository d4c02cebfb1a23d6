// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/base/mutex.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/vertex_response.h"
#include "core/mechanics/uncertainty/band_columns.h"
#include "core/mechanics/uncertainty/material_uncertainty.h"
#include "core/mesh/tet_mesh.h"
#include "server/session/memory_budget.h"
#include "server/session/session_progress.h"
#include "server/session/worker_pool.h"
#include "server/store/session_record.h"

namespace tissueform {

// Answers at chosen vertices that are to be prepared, see VertexResponse.
struct ResponseRequest {
  DeformationModel model = DeformationModel::kGradientField;
  std::vector<int32_t> vertices;
  double tolerance_mm = 0.01;
  double max_rotation_rad = 0.5236;
  double max_estimate_mm = 5;                      // of neo_hookean
  std::optional<MaterialUncertainty> ranges = {};  // of the elastic models: a band is wanted, too
  std::optional<LipEdge> seal = {};                // of linear_elastic: that of the session

  friend bool operator==(const ResponseRequest&, const ResponseRequest&) = default;
};

// Prepared answers with the memory that they take. Constant; goes with its last user.
struct SharedResponse {
  ResponseRequest request;
  MemoryReservation reservation;  // given back after the response is gone
  std::unique_ptr<const VertexResponse> response;
  // Null where no ranges were given. It knows no model: answers of another one may have the same,
  // and each is charged for it.
  std::shared_ptr<const BandColumns> band;
};

// The operators, factors and prepared answers of one mesh, one stiffness and one constraint set,
// which all sessions of these share: made once, constant from then on, charged to the memory budget
// once. Each session has deformers of its own on it, which hold workspaces only.
//
// What is marked so runs on strand(), which makes one thing after the other; the rest is
// thread-safe.
class SharedPreparation {
 public:
  // Both must outlive it.
  SharedPreparation(MemoryBudget* budget, WorkerPool* pool) : budget_(budget), strand_(pool) {}
  SharedPreparation(const SharedPreparation&) = delete;
  SharedPreparation& operator=(const SharedPreparation&) = delete;

  // Post with Lane::kBatch.
  Strand& strand() { return strand_; }

  // On the strand. The first call checks mesh, stiffness and regions; later ones, which say the
  // same, find it done. Errors: those of MeshPreparation::Create; ResourceExhausted.
  absl::Status Begin(const TetMesh& mesh, const Eigen::VectorXd& stiffness,
                     const ConstraintSet& constraints, PreparationOptions options);

  // On the strand. Makes the model with what it needs of the preparation. REQUIRES: Begin
  // succeeded.
  //
  // Errors: those of CreateDeformer; ResourceExhausted; Cancelled.
  absl::StatusOr<std::unique_ptr<Deformer>> MakeModel(const DeformerOptions& options,
                                                      const Cancellation& cancellation);

  // On the strand. Makes prepared answers unless the same were asked for before; some are kept
  // beside those in use (kMaxResponses, the last used). REQUIRES: Begin succeeded.
  //
  // Errors: InvalidArgument (a model that has none, a tolerance or range that is not possible),
  // and those of MakeModel.
  absl::StatusOr<std::shared_ptr<const SharedResponse>> PrepareResponse(
      const ResponseRequest& request, const GradientFieldOptions& gradient_field,
      const Cancellation& cancellation);

  // On the strand. Of each vertex the 95th percentile of the distance in mm, in first order, for an
  // answer of one of the elastic models: `deformed` (#V by 3, mm) under `poses`. With contact.
  // REQUIRES: Begin succeeded.
  //
  // Errors: those of ExpandAnswer; ResourceExhausted.
  absl::StatusOr<Eigen::VectorXf> FindMaterialBand(DeformationModel model,
                                                   const MaterialUncertainty& uncertainty,
                                                   absl::Span<const HandlePose> poses,
                                                   const Positions& deformed,
                                                   const Cancellation& cancellation);

  // Hears how far it is for as long as the result lives, while MakeModel makes what the model
  // needs, or PrepareResponse these answers, for any caller. Null where `on_progress` is empty.
  std::shared_ptr<const ProgressFeed::Follower> Follow(DeformationModel model,
                                                       SessionProgressCallback on_progress);
  std::shared_ptr<const ProgressFeed::Follower> Follow(const ResponseRequest& request,
                                                       SessionProgressCallback on_progress);

  // On the strand. MeshPreparation::node_order, for a record. REQUIRES: Begin succeeded.
  const std::vector<int32_t>& node_order() const { return preparation_->node_order(); }

  // With the prepared answers that are kept.
  int64_t bytes_held() const { return bytes_held_; }

 private:
  PreparationObserver Observer();
  // What a model takes that is still to be made, the factor apart.
  int64_t BytesBesideFactor(const DeformerOptions& options) const;
  absl::Status Admit(int64_t more_bytes);
  // That of answers that are kept; null where none has it.
  std::shared_ptr<const BandColumns> FindBand(const ResponseRequest& request) const;
  // After something was made or given up: what is held, no longer what was expected.
  void Settle();

  // Constant.
  MemoryBudget* const budget_;

  // Self-synchronised.
  Strand strand_;
  ProgressFeed feed_;
  std::atomic<int64_t> bytes_held_ = 0;

  // The strand's.
  MemoryReservation reservation_;
  std::shared_ptr<MeshPreparation> preparation_;                // null before Begin
  std::list<std::shared_ptr<const SharedResponse>> responses_;  // the last used first
};

// The preparations that sessions use at the moment, by what they are made from and whose they are.
//
// Thread-safe.
class SharedPreparations {
 public:
  // Both must outlive it and all it gave out.
  SharedPreparations(MemoryBudget* budget, WorkerPool* pool) : budget_(budget), pool_(pool) {}

  // That of sessions with the same owner, mesh, stiffness, regions, contact and Poisson's ratio, or
  // a new one. Never null.
  std::shared_ptr<SharedPreparation> Find(const SessionRecord& record);

 private:
  MemoryBudget* const budget_;
  WorkerPool* const pool_;

  Mutex mutex_;
  std::map<std::string, std::weak_ptr<SharedPreparation>> known_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
