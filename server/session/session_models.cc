// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_models.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "core/prepared_answers/linear_elastic_response.h"
#include "core/prepared_answers/response_basis.h"

namespace tissueform {
namespace {

constexpr size_t kMostResponses = 4;

// Upper bound of what the preparation and the models on the Laplacian hold and need while they are
// made, the factor apart: the mesh's operators, the system matrix and its parts (some 15 entries a
// row), harmonic fields at vertices and tets, and the workspaces of three right-hand sides.
int64_t LaplacianBytesBesideFactor(int64_t num_vertices, int64_t num_tets, int64_t num_handles) {
  constexpr int64_t kPerVertex = 1600;
  constexpr int64_t kPerVertexAndHandle = 40;
  constexpr int64_t kPerTet = 800;
  constexpr int64_t kPerTetAndHandle = 32;
  return num_vertices * (kPerVertex + kPerVertexAndHandle * num_handles) +
         num_tets * (kPerTet + kPerTetAndHandle * num_handles);
}

// The same for an elastic system: nine numbers with their indices for each entry of the Laplacian,
// whole and in parts, and the workspaces of the columns.
int64_t ElasticBytesBesideFactor(int64_t num_vertices) {
  constexpr int64_t kPerVertex = 8000;
  return num_vertices * kPerVertex;
}

// An answer and the messages that carry it: float64 once, float32 in up to three frames.
constexpr int64_t kAnswerBytesPerVertex = 3 * (8 + 3 * 4);

bool IsElastic(DeformationModel model) {
  return model == DeformationModel::kLinearElastic || model == DeformationModel::kNeoHookean;
}

}  // namespace

SessionModels::SessionModels(DeformerOptions options, MemoryBudget* budget)
    : options_(std::move(options)), budget_(budget) {
  options_.preparation.admission = [this](int64_t bytes) { return Admit(bytes); };
}

absl::Status SessionModels::Begin(const TetMesh& mesh, const Eigen::VectorXd& stiffness,
                                  const ConstraintSet& constraints) {
  TF_ASSIGN_OR_RETURN(reservation_,
                      budget_->Reserve(LaplacianBytesBesideFactor(
                                           mesh.num_vertices(), mesh.num_tets(),
                                           static_cast<int64_t>(constraints.handles().size())),
                                       "session"));
  TF_ASSIGN_OR_RETURN(preparation_,
                      MeshPreparation::Create(mesh, stiffness, constraints, options_.preparation));
  return absl::OkStatus();
}

absl::StatusOr<Deformer*> SessionModels::Prepare(DeformationModel model,
                                                 const Cancellation& cancellation) {
  if (const auto found = deformers_.find(model); found != deformers_.end()) {
    return found->second.get();
  }
  // First an upper bound of what the model takes beside its factor; the factor comes on top,
  // through the admission, as soon as its analysis has told its bytes; at the end Settle gives back
  // what was too much.
  TF_RETURN_IF_ERROR(cancellation.Check());
  const TetMesh& mesh = preparation_->mesh();
  const bool makes_elastic = IsElastic(model) && !preparation_->has_elastic();
  if (makes_elastic) {
    TF_RETURN_IF_ERROR(Admit(ElasticBytesBesideFactor(mesh.num_vertices())));
  } else if (!deformers_.empty()) {
    TF_RETURN_IF_ERROR(Admit(LaplacianBytesBesideFactor(
        mesh.num_vertices(), mesh.num_tets(),
        static_cast<int64_t>(preparation_->constraints().handles().size()))));
  }
  DeformerOptions options = options_;
  options.model = model;
  absl::StatusOr<std::unique_ptr<Deformer>> deformer =
      CreateDeformer(preparation_, options, cancellation);
  if (!deformer.ok()) {
    Settle().IgnoreError();  // less than before
    return deformer.status();
  }
  Deformer* const made = deformer->get();
  deformers_[model] = *std::move(deformer);
  if (const absl::Status room = Settle(); !room.ok()) {
    deformers_.erase(model);
    return room;
  }
  return made;
}

absl::StatusOr<VertexResponse*> SessionModels::PrepareResponse(const ResponseRequest& request,
                                                               const Cancellation& cancellation) {
  const auto found =
      std::find_if(responses_.begin(), responses_.end(),
                   [&request](const auto& prepared) { return prepared.request == request; });
  if (found != responses_.end()) {
    responses_.splice(responses_.begin(), responses_, found);
    return responses_.front().response.get();
  }
  TF_RETURN_IF_ERROR(Prepare(request.model, cancellation).status());
  // Before the new one is made, so that old and new need not fit together.
  while (responses_.size() >= kMostResponses) responses_.pop_back();
  TF_RETURN_IF_ERROR(Settle());
  absl::StatusOr<std::unique_ptr<VertexResponse>> response = CreateResponse(request, cancellation);
  if (!response.ok()) {
    Settle().IgnoreError();  // less than before
    return response.status();
  }
  responses_.push_front({request, *std::move(response)});
  if (const absl::Status room = Settle(); !room.ok()) {
    responses_.pop_front();
    return room;
  }
  return responses_.front().response.get();
}

absl::StatusOr<std::unique_ptr<VertexResponse>> SessionModels::CreateResponse(
    const ResponseRequest& request, const Cancellation& cancellation) {
  const FactorAdmission admission = [this](int64_t bytes) { return Admit(bytes); };
  if (request.model == DeformationModel::kLinearElastic) {
    return CreateLinearElasticResponse(
        preparation_, request.vertices,
        {.tolerance_mm = request.tolerance_mm, .admission = admission}, cancellation);
  }
  if (request.model == DeformationModel::kGradientField &&
      options_.gradient_field.rotation == RotationMode::kPropagated &&
      options_.gradient_field.guidance == Guidance::kCotangent) {
    return CreateResponseBasis(preparation_, request.vertices,
                               {.tolerance_mm = request.tolerance_mm,
                                .max_rotation_rad = request.max_rotation_rad,
                                .admission = admission},
                               cancellation);
  }
  return absl::InvalidArgumentError(
      "only gradient_field with propagated rotations and cotangent guidance, and linear_elastic, "
      "have prepared answers; leave `prepared` out");
}

absl::Status SessionModels::Admit(int64_t more_bytes) {
  return reservation_.Resize(reservation_.bytes() + more_bytes,
                             "matrix factor or prepared answers");
}

absl::Status SessionModels::Settle() { return reservation_.Resize(BytesHeld(), "session"); }

int64_t SessionModels::BytesHeld() const {
  int64_t bytes =
      preparation_->bytes_held() + kAnswerBytesPerVertex * preparation_->mesh().num_vertices();
  for (const auto& [model, deformer] : deformers_) bytes += deformer->preparation().own_bytes;
  for (const PreparedResponse& prepared : responses_) bytes += prepared.response->bytes_held();
  return bytes;
}

}  // namespace tissueform
