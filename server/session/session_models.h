// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/cancellation.h"
#include "core/constraints/constraint_set.h"
#include "core/deformation/create_deformer.h"
#include "core/deformation/mesh_preparation.h"
#include "core/mesh/tet_mesh.h"
#include "core/prepared_answers/vertex_response.h"
#include "server/session/memory_budget.h"

namespace tissueform {

// Answers at chosen vertices that are to be prepared, see VertexResponse.
struct ResponseRequest {
  DeformationModel model = DeformationModel::kGradientField;
  std::vector<int32_t> vertices;
  double tolerance_mm = 0.01;
  double max_rotation_rad = 0.5236;

  friend bool operator==(const ResponseRequest&, const ResponseRequest&) = default;
};

// The models of one session on one shared preparation, each made when it is first asked for, and
// the prepared answers of its streams. Takes of the memory budget what it is about to allocate. One
// thread at a time.
class SessionModels {
 public:
  // `budget` must outlive it. `options.model` is what Prepare is first called with.
  SessionModels(DeformerOptions options, MemoryBudget* budget);
  SessionModels(const SessionModels&) = delete;
  SessionModels& operator=(const SessionModels&) = delete;

  // Checks mesh, stiffness and regions. Errors: those of MeshPreparation::Create;
  // ResourceExhausted.
  absl::Status Begin(const TetMesh& mesh, const Eigen::VectorXd& stiffness,
                     const ConstraintSet& constraints);

  // Makes the model unless it exists. REQUIRES: Begin succeeded.
  //
  // Errors: those of CreateDeformer; ResourceExhausted; Cancelled.
  absl::StatusOr<Deformer*> Prepare(DeformationModel model, const Cancellation& cancellation);

  // Makes prepared answers unless the same were asked for before. Some are kept (kMostResponses);
  // the one that was not used for longest makes way, so use the pointer before the next call.
  //
  // Errors: InvalidArgument (a model that has none, a tolerance or range that is not possible), and
  // those of Prepare.
  absl::StatusOr<VertexResponse*> PrepareResponse(const ResponseRequest& request,
                                                  const Cancellation& cancellation);

  int64_t bytes_held() const { return reservation_.bytes(); }

 private:
  struct PreparedResponse {
    ResponseRequest request;
    std::unique_ptr<VertexResponse> response;
  };

  absl::StatusOr<std::unique_ptr<VertexResponse>> CreateResponse(const ResponseRequest& request,
                                                                 const Cancellation& cancellation);
  absl::Status Admit(int64_t more_bytes);
  // After something was made or given up: what is held, no longer what was expected.
  absl::Status Settle();
  int64_t BytesHeld() const;

  // Constant.
  DeformerOptions options_;
  MemoryBudget* const budget_;

  MemoryReservation reservation_;
  std::shared_ptr<MeshPreparation> preparation_;
  std::map<DeformationModel, std::unique_ptr<Deformer>> deformers_;
  std::list<PreparedResponse> responses_;  // the last used first
};

}  // namespace tissueform
