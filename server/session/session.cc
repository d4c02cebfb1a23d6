// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"

namespace tissueform {
namespace {

absl::StatusOr<Eigen::VectorXd> ResolveStiffness(const SessionRecord& record,
                                                 const StoredMesh& mesh) {
  if (const double* uniform = std::get_if<double>(&record.stiffness)) {
    return Eigen::VectorXd::Constant(mesh.mesh.num_tets(), *uniform);
  }
  const std::string& name = std::get<std::string>(record.stiffness);
  const CellArray* array = mesh.FindCellArray(name);
  if (array == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the mesh has no cell array \"", name, "\" for the stiffness; upload the mesh with it"));
  }
  return array->values;
}

}  // namespace

Session::Session(const SessionRecord& record, std::shared_ptr<const StoredMesh> mesh,
                 ConstraintSet constraints, WorkerPool* pool, const Clock* clock)
    : clock_(clock),
      id_(record.id),
      mesh_(std::move(mesh)),
      constraints_(std::move(constraints)),
      model_(record.model),
      poisson_ratio_(record.poisson_ratio),
      gradient_field_(record.gradient_field),
      strand_(pool),
      last_used_(clock->Now()) {}

absl::StatusOr<std::shared_ptr<Session>> Session::Create(SessionRecord record,
                                                         std::shared_ptr<const StoredMesh> mesh,
                                                         MemoryBudget* budget, WorkerPool* pool,
                                                         const Clock* clock,
                                                         const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(cancellation.Check());
  TF_ASSIGN_OR_RETURN(
      ConstraintSet constraints,
      ConstraintSet::Create(mesh->mesh, std::move(record.fixed), std::move(record.handles)));
  TF_ASSIGN_OR_RETURN(const Eigen::VectorXd stiffness, ResolveStiffness(record, *mesh));
  std::shared_ptr<Session> session(
      new Session(record, std::move(mesh), std::move(constraints), pool, clock));
  TF_RETURN_IF_ERROR(session->Prepare(stiffness, budget, cancellation));
  return session;
}

absl::Status Session::Prepare(const Eigen::VectorXd& stiffness, MemoryBudget* budget,
                              const Cancellation& cancellation) {
  DeformerOptions options;
  options.model = model_;
  options.preparation.poisson_ratio = poisson_ratio_;
  options.preparation.mesh_is_usable = true;  // MeshCatalog
  options.gradient_field = gradient_field_;
  // Told in every answer; a small part of a solve.
  options.gradient_field.compute_residual = true;
  models_ = std::make_unique<SessionModels>(std::move(options), budget);
  TF_RETURN_IF_ERROR(models_->Begin(mesh_->mesh, stiffness, constraints_));
  TF_ASSIGN_OR_RETURN(const Deformer* deformer, models_->Prepare(model_, cancellation));
  preparation_ = deformer->preparation();
  bytes_held_ = models_->bytes_held();
  Touch();
  return absl::OkStatus();
}

absl::Status Session::CheckOpen() const {
  if (models_ != nullptr) return absl::OkStatus();
  return absl::NotFoundError(absl::StrCat("sessions/", id_, " has been deleted; create it again"));
}

absl::Status Session::PrepareModel(DeformationModel model, const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckOpen());
  const absl::Status status = models_->Prepare(model, cancellation).status();
  bytes_held_ = models_->bytes_held();
  return status;
}

absl::StatusOr<VertexResponse*> Session::PrepareResponse(const ResponseRequest& request,
                                                         const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckOpen());
  absl::StatusOr<VertexResponse*> response = models_->PrepareResponse(request, cancellation);
  bytes_held_ = models_->bytes_held();
  return response;
}

absl::StatusOr<Deformation> Session::Deform(DeformationModel model,
                                            absl::Span<const HandlePose> poses,
                                            const DeformControl& control) {
  Touch();
  TF_RETURN_IF_ERROR(CheckOpen());
  const absl::StatusOr<Deformer*> deformer = models_->Prepare(model, {});
  bytes_held_ = models_->bytes_held();
  TF_RETURN_IF_ERROR(deformer.status());
  return (*deformer)->Deform(poses, control);
}

absl::StatusOr<std::optional<PreparedAnswer>> Session::Respond(const ResponseRequest& request,
                                                               absl::Span<const HandlePose> poses) {
  Touch();
  const Stopwatch stopwatch;
  TF_ASSIGN_OR_RETURN(VertexResponse* const response, PrepareResponse(request, {}));
  if (!response->Covers(poses)) return std::optional<PreparedAnswer>();
  PreparedAnswer answer;
  response->Evaluate(poses, &answer.positions);
  answer.summary.iterations = 0;
  answer.summary.prepared = true;
  answer.summary.error_bound_mm = response->ErrorBoundMm(poses);
  answer.summary.solve_seconds = stopwatch.Seconds();
  return std::optional<PreparedAnswer>(std::move(answer));
}

void Session::Close() { models_.reset(); }

}  // namespace tissueform
