// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Upper bound of what a deformer holds and needs for its preparation, the factor apart: gradient
// and divergence (12 numbers a tet each, with indices), the system matrix and its parts (some 15
// entries a row), harmonic fields at vertices and tets, and the workspaces of three right-hand
// sides.
int64_t EstimateBytesBesideFactor(int64_t num_vertices, int64_t num_tets, int64_t num_handles) {
  constexpr int64_t kPerVertex = 1600;
  constexpr int64_t kPerVertexAndHandle = 40;
  constexpr int64_t kPerTet = 800;
  constexpr int64_t kPerTetAndHandle = 32;
  return num_vertices * (kPerVertex + kPerVertexAndHandle * num_handles) +
         num_tets * (kPerTet + kPerTetAndHandle * num_handles);
}

// An answer and the messages that carry it: float64 once, float32 in up to three frames.
constexpr int64_t kAnswerBytesPerVertex = 3 * (8 + 3 * 4);

absl::StatusOr<Eigen::VectorXd> ResolveStiffness(const SessionSpec& spec) {
  if (const double* uniform = std::get_if<double>(&spec.stiffness)) {
    return Eigen::VectorXd::Constant(spec.mesh->mesh.num_tets(), *uniform);
  }
  const std::string& name = std::get<std::string>(spec.stiffness);
  const CellArray* array = spec.mesh->FindCellArray(name);
  if (array == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the mesh has no cell array \"", name, "\" for the stiffness; upload the mesh with it"));
  }
  return array->values;
}

}  // namespace

Session::Session(std::string id, SessionSpec spec, ConstraintSet constraints, WorkerPool* pool)
    : id_(std::move(id)),
      mesh_(std::move(spec.mesh)),
      constraints_(std::move(constraints)),
      model_(spec.model),
      gradient_field_(spec.gradient_field),
      strand_(pool),
      last_used_(std::chrono::steady_clock::now()) {}

absl::StatusOr<std::shared_ptr<Session>> Session::Create(std::string id, SessionSpec spec,
                                                         MemoryBudget* budget, WorkerPool* pool,
                                                         const CancelledFunction& cancelled) {
  TF_ASSIGN_OR_RETURN(
      ConstraintSet constraints,
      ConstraintSet::Create(spec.mesh->mesh, std::move(spec.fixed), std::move(spec.handles)));
  TF_ASSIGN_OR_RETURN(const Eigen::VectorXd stiffness, ResolveStiffness(spec));
  std::shared_ptr<Session> session(
      new Session(std::move(id), std::move(spec), std::move(constraints), pool));
  TF_RETURN_IF_ERROR(session->Prepare(stiffness, budget, cancelled));
  return session;
}

absl::Status Session::Prepare(const Eigen::VectorXd& stiffness, MemoryBudget* budget,
                              const CancelledFunction& cancelled) {
  const TetMesh& mesh = mesh_->mesh;
  const int64_t beside_factor = EstimateBytesBesideFactor(
      mesh.num_vertices(), mesh.num_tets(), static_cast<int64_t>(constraints_.handles().size()));
  TF_ASSIGN_OR_RETURN(reservation_, budget->Reserve(beside_factor, "session"));

  DeformerOptions options;
  options.model = model_;
  options.gradient_field = gradient_field_;
  // Told in every answer; a small part of a solve.
  options.gradient_field.compute_residual = true;
  // Called for every factor; uniform guidance has a second one for a while.
  options.gradient_field.admission = [this, reserved = beside_factor,
                                      &cancelled](int64_t factor_bytes) mutable -> absl::Status {
    if (cancelled()) {
      return absl::CancelledError("the client has cancelled the call");
    }
    reserved += factor_bytes;
    return reservation_.Resize(reserved, "matrix factor");
  };
  TF_ASSIGN_OR_RETURN(deformer_, CreateDeformer(mesh, stiffness, constraints_, options));
  preparation_ = deformer_->preparation();
  bytes_held_ = preparation_.bytes_held + kAnswerBytesPerVertex * mesh.num_vertices();
  Touch();
  return reservation_.Resize(bytes_held_, "session");
}

absl::StatusOr<Deformation> Session::Deform(absl::Span<const HandlePose> poses,
                                            const DeformControl& control) {
  if (deformer_ == nullptr) {
    return absl::NotFoundError(
        absl::StrCat("sessions/", id_, " has been deleted; create it again"));
  }
  Touch();
  return deformer_->Deform(poses, control);
}

void Session::Close() {
  deformer_.reset();
  reservation_ = MemoryReservation();
}

}  // namespace tissueform
