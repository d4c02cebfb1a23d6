// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cpp/tissueform_client.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/mesh/payload/mesh_payload.h"

namespace tissueform {

// A session on a server that was made from a plan, whether that was read from files or has just
// been built (core/mechanics/problem). It is deleted with this object, also after errors.
class PlanSession {
 public:
  // Uploads the mesh with the stiffness of its tets unless the server has both, and makes the
  // session. `client` must outlive the result.
  //
  // Errors: those of UploadMesh and CreateSession.
  static absl::StatusOr<std::unique_ptr<PlanSession>> Create(TissueformClient* client,
                                                             const PlanProblem& problem);
  // The same for a caller that waits for it. Where `stream` is given, what a stream with these
  // options asks for is made ready, too. Errors: also those of PrepareSession.
  static absl::StatusOr<std::unique_ptr<PlanSession>> Create(
      TissueformClient* client, const PlanProblem& problem, const PreparationWait& wait,
      const DeformStream::Options* stream = nullptr);
  ~PlanSession();
  PlanSession(const PlanSession&) = delete;
  PlanSession& operator=(const PlanSession&) = delete;

  // "sessions/{id}": what DeformOnce and OpenStream of the client take.
  const std::string& name() const { return description_.name(); }
  const v1::Session& description() const { return description_; }

 private:
  PlanSession(TissueformClient* client, v1::Session description);

  TissueformClient* const client_;
  const v1::Session description_;
};

// What PlanSession::Create does, step by step: for those who want more than one session of a plan.
absl::StatusOr<v1::Mesh> UploadMeshOf(TissueformClient* client, const PlanProblem& problem);
// With which UploadMeshOf sends the mesh: the stiffness of its tets.
std::vector<CellArray> CellArraysOf(const PlanProblem& problem);
// The name of the mesh that UploadMeshOf uploads, without a server.
std::string MeshNameOf(const PlanProblem& problem);
SessionRequest SessionRequestOf(const PlanProblem& problem, const std::string& mesh);

// The poses of the plan with the names of their handles.
std::vector<NamedPose> NamedPoses(const PlanProblem& problem);

// Prepared answers with the usual tolerances, and with the plan's ranges of the material where it
// gives some and its model supports them, which it does not with contact: then frames hold
// uncertainty_p95_mm. REQUIRES: HasPreparedAnswers(problem.deformer, ...).
v1::PreparedAnswers PreparedAnswersOf(const PlanProblem& problem);

}  // namespace tissueform
