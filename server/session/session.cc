// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "server/session/session_errors.h"

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

DeformerOptions OptionsOf(const SessionRecord& record) {
  DeformerOptions options;
  options.model = record.model;
  options.preparation.poisson_ratio = record.poisson_ratio;
  options.preparation.mesh_is_usable = true;  // MeshCatalog
  options.preparation.node_order = record.node_order;
  options.gradient_field = record.gradient_field;
  if (record.seals_lips) options.seal = record.lip_edge;
  // Reported in every answer; a small part of a solve.
  options.gradient_field.compute_residual = true;
  return options;
}

// An answer and the messages that carry it: float64 once, float32 in up to three frames.
constexpr int64_t kAnswerBytesPerVertex = 3 * (8 + 3 * 4);

}  // namespace

Session::Session(const SessionRecord& record, std::shared_ptr<const StoredMesh> mesh,
                 ConstraintSet constraints, const Strand& making_strand, MemoryBudget* budget,
                 WorkerPool* pool, const Clock* clock)
    : clock_(clock),
      budget_(budget),
      pool_(pool),
      id_(record.id),
      mesh_(std::move(mesh)),
      constraints_(std::move(constraints)),
      stiffness_(record.stiffness),
      options_(OptionsOf(record)),
      strand_(pool),
      making_strand_(making_strand),
      last_used_(clock->Now()) {}

absl::StatusOr<std::shared_ptr<Session>> Session::Create(
    SessionRecord record, std::shared_ptr<const StoredMesh> mesh,
    std::shared_ptr<SharedPreparation> preparation, MemoryBudget* budget, WorkerPool* pool,
    const Clock* clock, const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(cancellation.Check());
  TF_ASSIGN_OR_RETURN(ConstraintSet constraints,
                      ConstraintSet::Create(mesh->mesh, std::move(record.fixed),
                                            std::move(record.handles), std::move(record.contact)));
  if (record.lip_edge) {
    TF_RETURN_IF_ERROR(
        CheckLipEdge(*record.lip_edge, mesh->mesh.positions(), constraints.contact()));
  }
  TF_ASSIGN_OR_RETURN(const Eigen::VectorXd stiffness, ResolveStiffness(record, *mesh));
  std::shared_ptr<Session> session(new Session(record, std::move(mesh), std::move(constraints),
                                               preparation->strand(), budget, pool, clock));
  TF_RETURN_IF_ERROR(session->Prepare(stiffness, std::move(preparation), cancellation));
  return session;
}

absl::Status Session::Prepare(const Eigen::VectorXd& stiffness,
                              std::shared_ptr<SharedPreparation> preparation,
                              const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(
      preparation->Begin(mesh_->mesh, stiffness, constraints_, options_.preparation));
  Models models;
  models.preparation = std::move(preparation);
  TF_ASSIGN_OR_RETURN(
      models.reservation,
      budget_->Reserve(kAnswerBytesPerVertex * mesh_->mesh.num_vertices(), "session"));
  own_bytes_ = models.reservation.bytes();
  {
    MutexLock lock(mutex_);
    models_ = std::move(models);
  }
  TF_RETURN_IF_ERROR(PrepareModel(options_.model, cancellation));
  Touch();
  return absl::OkStatus();
}

absl::Status Session::Closed() const {
  if (moved_) return SessionMoved("");
  if (updated_) {
    return WithReason(absl::AbortedError(absl::StrCat("sessions/", id_, " was updated; try again")),
                      ErrorReason::kSessionUpdated);
  }
  return WithReason(
      absl::NotFoundError(absl::StrCat("sessions/", id_, " was deleted; create it again")),
      ErrorReason::kSessionNotFound);
}

absl::StatusOr<std::shared_ptr<SharedPreparation>> Session::OpenPreparation() const {
  MutexLock lock(mutex_);
  if (!models_.has_value()) return Closed();
  return models_->preparation;
}

std::shared_ptr<const SharedPreparation> Session::shared_preparation() const {
  MutexLock lock(mutex_);
  return models_.has_value() ? models_->preparation : nullptr;
}

int64_t Session::shared_bytes() const {
  const std::shared_ptr<const SharedPreparation> shared = shared_preparation();
  return shared == nullptr ? 0 : shared->bytes_held();
}

bool Session::HasModel(DeformationModel model) const {
  MutexLock lock(mutex_);
  return models_.has_value() && models_->models.contains(model);
}

Lane Session::LaneOf(DeformationModel model) const {
  return Iterates(model, options_.gradient_field) ? Lane::kIterations : Lane::kSolves;
}

absl::Status Session::PrepareModel(DeformationModel model, const Cancellation& cancellation) {
  making_ = true;
  const absl::Status status = MakeModel(model, cancellation);
  making_ = false;
  return status;
}

absl::Status Session::MakeModel(DeformationModel model, const Cancellation& cancellation) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<SharedPreparation> preparation, OpenPreparation());
  if (HasModel(model)) return absl::OkStatus();
  DeformerOptions options = options_;
  options.model = model;
  Model made;
  TF_ASSIGN_OR_RETURN(made.deformer, preparation->MakeModel(options, cancellation));
  TF_ASSIGN_OR_RETURN(made.reservation,
                      budget_->Reserve(made.deformer->preparation().own_bytes, "session"));
  if (model == options_.model) summary_ = made.deformer->preparation();
  return Keep(model, std::move(made));
}

absl::Status Session::Keep(DeformationModel model, Model made) {
  MutexLock lock(mutex_);
  if (!models_.has_value()) return Closed();
  own_bytes_ += made.reservation.bytes();
  models_->models[model] = std::move(made);
  return absl::OkStatus();
}

// Sessions with free and with sealed lips share a preparation.
ResponseRequest Session::Sealed(ResponseRequest request) const {
  request.seal = options_.seal;
  return request;
}

absl::StatusOr<std::shared_ptr<PreparedAnswersRef>> Session::PrepareResponse(
    const ResponseRequest& request, const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(PrepareModel(request.model, cancellation));
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<SharedPreparation> preparation, OpenPreparation());
  making_ = true;
  absl::StatusOr<std::shared_ptr<const SharedResponse>> response =
      preparation->PrepareResponse(Sealed(request), options_.gradient_field, cancellation);
  making_ = false;
  TF_RETURN_IF_ERROR(response.status());
  auto claim = std::make_shared<PreparedAnswersRef>(*std::move(response));
  MutexLock lock(mutex_);
  if (!models_.has_value()) {
    claim->Drop();
    return claim;
  }
  std::erase_if(models_->claims, [](const auto& known) { return known.expired(); });
  models_->claims.push_back(claim);
  return claim;
}

absl::StatusOr<Eigen::VectorXf> Session::FindMaterialBand(DeformationModel model,
                                                          const MaterialUncertainty& uncertainty,
                                                          absl::Span<const HandlePose> poses,
                                                          const Positions& deformed,
                                                          const Cancellation& cancellation) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<SharedPreparation> preparation, OpenPreparation());
  making_ = true;
  absl::StatusOr<Eigen::VectorXf> band =
      preparation->FindMaterialBand(model, uncertainty, poses, deformed, cancellation);
  making_ = false;
  return band;
}

std::shared_ptr<const ProgressFeed::Follower> Session::Follow(
    const ResponseRequest& request, SessionProgressCallback on_progress) const {
  const absl::StatusOr<std::shared_ptr<SharedPreparation>> preparation = OpenPreparation();
  return preparation.ok() ? (*preparation)->Follow(request, std::move(on_progress)) : nullptr;
}

absl::StatusOr<Deformation> Session::Solve(DeformationModel model,
                                           absl::Span<const HandlePose> poses,
                                           const DeformControl& control) {
  Touch();
  std::shared_ptr<Deformer> deformer;
  {
    MutexLock lock(mutex_);
    if (!models_.has_value()) return Closed();
    const auto found = models_->models.find(model);
    if (found == models_->models.end()) {
      return absl::FailedPreconditionError("the model of this answer was not prepared");
    }
    deformer = found->second.deformer;
  }
  // A search that stalls takes a second factor, which goes with the answer.
  TF_ASSIGN_OR_RETURN(MemoryReservation room, budget_->Reserve(0, "session"));
  DeformControl with_room = control;
  with_room.admission = [&room](int64_t bytes) {
    return room.Resize(room.bytes() + bytes, "second factor of the search");
  };
  return deformer->Deform(poses, with_room);
}

absl::StatusOr<std::optional<PreparedAnswer>> Session::Respond(const PreparedAnswersRef& claim,
                                                               absl::Span<const HandlePose> poses) {
  Touch();
  const Stopwatch stopwatch;
  const std::shared_ptr<const SharedResponse> shared = claim.Get();
  if (shared == nullptr) return Closed();
  PreparedAnswer answer;
  const std::optional<double> bound_mm = shared->response->Answer(poses, &answer.positions);
  if (!bound_mm.has_value()) return std::optional<PreparedAnswer>();
  answer.summary.iterations = 0;
  answer.summary.prepared = true;
  (shared->response->error_is_estimate() ? answer.summary.error_estimate_mm
                                         : answer.summary.error_bound_mm) = *bound_mm;
  if (shared->band != nullptr) {
    shared->band->Evaluate(poses, shared->request.max_rotation_rad, &answer.band_mm);
  }
  answer.summary.solve_seconds = stopwatch.Seconds();
  return std::optional<PreparedAnswer>(std::move(answer));
}

void Session::Close(CloseReason reason) {
  std::optional<Models> closed;  // ends without the lock
  {
    MutexLock lock(mutex_);
    // First: who finds it closed asks why.
    moved_ = reason == CloseReason::kMoved;
    evicted_ = reason == CloseReason::kEvicted || reason == CloseReason::kUpdated;
    std::swap(closed, models_);
    own_bytes_ = 0;
  }
  if (!closed.has_value()) return;
  for (const std::weak_ptr<PreparedAnswersRef>& known : closed->claims) {
    if (const std::shared_ptr<PreparedAnswersRef> claim = known.lock()) claim->Drop();
  }
}

}  // namespace tissueform
