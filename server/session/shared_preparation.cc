// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/shared_preparation.h"

#include <algorithm>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/hash/hash.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/mechanics/uncertainty/material_expansion.h"
#include "core/mechanics/uncertainty/uncertainty_band.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

// Kept for streams that come back, beside what open streams hold.
constexpr size_t kMaxResponses = 4;

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

// Topics of the feed. Models of one factor share one: it is what takes the time.
size_t TopicOf(DeformationModel model) { return TraitsOf(model).is_elastic ? 1 : 0; }
size_t TopicOf(const ResponseRequest& request) {
  return absl::HashOf(request.model, request.vertices, request.tolerance_mm,
                      request.max_rotation_rad);
}

// A model on what is there already: transforms of the tets and fields at vertices.
int64_t ModelBytes(int64_t num_vertices, int64_t num_tets) {
  constexpr int64_t kPerVertex = 200;
  constexpr int64_t kPerTet = 240;
  return num_vertices * kPerVertex + num_tets * kPerTet;
}

int64_t NumHandles(const ConstraintSet& constraints) {
  return static_cast<int64_t>(constraints.handles().size());
}

}  // namespace

absl::Status SharedPreparation::Begin(const TetMesh& mesh, const Eigen::VectorXd& stiffness,
                                      const ConstraintSet& constraints,
                                      PreparationOptions options) {
  if (preparation_ != nullptr) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(
      MemoryReservation reservation,
      budget_->Reserve(
          LaplacianBytesBesideFactor(mesh.num_vertices(), mesh.num_tets(), NumHandles(constraints)),
          "session"));
  options.admission = [this](int64_t bytes) { return Admit(bytes); };
  options.observer = Observer();
  TF_ASSIGN_OR_RETURN(preparation_,
                      MeshPreparation::Create(mesh, stiffness, constraints, std::move(options)));
  reservation_ = std::move(reservation);
  Settle();
  return absl::OkStatus();
}

int64_t SharedPreparation::BytesBesideFactor(const DeformerOptions& options) const {
  const int64_t vertices = preparation_->mesh().num_vertices();
  const int64_t tets = preparation_->mesh().num_tets();
  const int64_t laplacian =
      LaplacianBytesBesideFactor(vertices, tets, NumHandles(preparation_->constraints()));
  if (TraitsOf(options.model).is_elastic) {
    return preparation_->has_elastic() ? ModelBytes(vertices, tets)
                                       : laplacian + ElasticBytesBesideFactor(vertices);
  }
  const bool makes_factor =
      !preparation_->has_laplacian() || (options.model == DeformationModel::kGradientField &&
                                         options.gradient_field.guidance == Guidance::kUniform);
  return makes_factor ? laplacian : ModelBytes(vertices, tets);
}

absl::StatusOr<std::unique_ptr<Deformer>> SharedPreparation::MakeModel(
    const DeformerOptions& options, const Cancellation& cancellation) {
  // First an upper bound of what the model takes beside its factor; the factor comes on top,
  // through the admission, as soon as its analysis has reported its bytes; at the end Settle gives
  // back what was too much.
  feed_.Begin(TopicOf(options.model));
  const absl::Cleanup end_of_topic = [this] { feed_.End(); };
  TF_RETURN_IF_ERROR(cancellation.Check());
  TF_RETURN_IF_ERROR(Admit(BytesBesideFactor(options)));
  absl::StatusOr<std::unique_ptr<Deformer>> deformer =
      CreateDeformer(preparation_, options, cancellation);
  Settle();
  return deformer;
}

absl::StatusOr<std::shared_ptr<const SharedResponse>> SharedPreparation::PrepareResponse(
    const ResponseRequest& request, const GradientFieldOptions& gradient_field,
    const Cancellation& cancellation) {
  const auto found =
      std::find_if(responses_.begin(), responses_.end(),
                   [&request](const auto& prepared) { return prepared->request == request; });
  if (found != responses_.end()) {
    responses_.splice(responses_.begin(), responses_, found);
    return responses_.front();
  }
  const ConstraintSet& constraints = preparation_->constraints();
  if (!HasPreparedAnswers(request.model, gradient_field, constraints)) {
    return WithReason(absl::InvalidArgumentError(absl::StrCat(
                          "the model has no prepared answers; leave `prepared` out, or choose ",
                          ModelsWithPreparedAnswers(constraints))),
                      ErrorReason::kNoPreparedAnswers);
  }
  feed_.Begin(TopicOf(request));
  const absl::Cleanup end_of_topic = [this] { feed_.End(); };
  std::shared_ptr<const BandColumns> band = FindBand(request);
  // Before the new one is made, so that old and new need not fit together.
  while (responses_.size() >= kMaxResponses) responses_.pop_back();
  Settle();
  auto shared = std::make_shared<SharedResponse>();
  shared->request = request;
  TF_ASSIGN_OR_RETURN(shared->reservation, budget_->Reserve(0, "prepared answers"));
  const FactorAdmission admission = [&shared](int64_t bytes) {
    return shared->reservation.Resize(shared->reservation.bytes() + bytes, "prepared answers");
  };
  absl::StatusOr<std::unique_ptr<VertexResponse>> response =
      CreateResponse(preparation_, request.vertices,
                     {.model = request.model,
                      .tolerance_mm = request.tolerance_mm,
                      .max_rotation_rad = request.max_rotation_rad,
                      .max_estimate_mm = request.max_estimate_mm,
                      .seal = request.seal,
                      .admission = admission,
                      .observer = Observer()},
                     cancellation);
  TF_RETURN_IF_ERROR(response.status());
  shared->response = *std::move(response);
  int64_t bytes = shared->response->bytes_held();
  if (request.ranges.has_value()) {
    if (band == nullptr) {
      TF_ASSIGN_OR_RETURN(band, BandColumns::Create(preparation_, *request.ranges, request.vertices,
                                                    admission, cancellation));
    }
    bytes += band->bytes_held();
    shared->band = std::move(band);
  }
  TF_RETURN_IF_ERROR(shared->reservation.Resize(bytes, "prepared answers"));
  responses_.push_front(std::move(shared));
  Settle();
  return responses_.front();
}

std::shared_ptr<const BandColumns> SharedPreparation::FindBand(
    const ResponseRequest& request) const {
  if (!request.ranges.has_value()) return nullptr;
  for (const auto& prepared : responses_) {
    const ResponseRequest& made = prepared->request;
    if (made.ranges == request.ranges && made.vertices == request.vertices) return prepared->band;
  }
  return nullptr;
}

absl::StatusOr<Eigen::VectorXf> SharedPreparation::FindMaterialBand(
    DeformationModel model, const MaterialUncertainty& uncertainty,
    absl::Span<const HandlePose> poses, const Positions& deformed,
    const Cancellation& cancellation) {
  // Of each tissue and of Poisson's ratio forces and a field, besides what the expansion admits.
  const int64_t terms = static_cast<int64_t>(uncertainty.tissues.size()) + 1;
  TF_RETURN_IF_ERROR(Admit(3 * terms * deformed.size() * static_cast<int64_t>(sizeof(double))));
  const absl::Cleanup settle = [this] { Settle(); };
  TF_ASSIGN_OR_RETURN(const AnswerExpansion expansion,
                      ExpandAnswer(preparation_.get(), model, uncertainty, poses, deformed,
                                   ExpansionOrder::kFirst, cancellation));
  Eigen::MatrixXf fields(deformed.size(), static_cast<Eigen::Index>(expansion.terms.size()));
  for (size_t t = 0; t < expansion.terms.size(); ++t) {
    fields.col(static_cast<Eigen::Index>(t)) = expansion.terms[t].field.col(0).cast<float>();
  }
  return FirstOrderBand(fields);
}

std::shared_ptr<const ProgressFeed::Follower> SharedPreparation::Follow(
    DeformationModel model, SessionProgressCallback on_progress) {
  return feed_.Follow(TopicOf(model), std::move(on_progress));
}

std::shared_ptr<const ProgressFeed::Follower> SharedPreparation::Follow(
    const ResponseRequest& request, SessionProgressCallback on_progress) {
  return feed_.Follow(TopicOf(request), std::move(on_progress));
}

PreparationObserver SharedPreparation::Observer() {
  return [this](const PreparationProgress& progress) { feed_.Report(ToSessionProgress(progress)); };
}

absl::Status SharedPreparation::Admit(int64_t more_bytes) {
  return reservation_.Resize(reservation_.bytes() + more_bytes, "matrix factor");
}

void SharedPreparation::Settle() {
  const int64_t bytes = preparation_->bytes_held();
  // What is made was admitted, so this is less than before.
  reservation_.Resize(bytes, "session").IgnoreError();
  int64_t of_responses = 0;
  for (const auto& shared : responses_) of_responses += shared->reservation.bytes();
  bytes_held_ = bytes + of_responses;
}

std::shared_ptr<SharedPreparation> SharedPreparations::Find(const SessionRecord& record) {
  SessionRecord key;
  key.owner = record.owner;
  key.project = record.project;
  key.mesh_sha256 = record.mesh_sha256;
  key.stiffness = record.stiffness;
  key.fixed = record.fixed;
  key.handles = record.handles;
  key.contact = record.contact;
  key.poisson_ratio = record.poisson_ratio;
  std::string digest = Sha256Hex({SerializeRecord(key)});
  MutexLock lock(mutex_);
  // No more entries than sessions that live, and those that ended since the last call.
  std::erase_if(known_, [](const auto& entry) { return entry.second.expired(); });
  std::weak_ptr<SharedPreparation>& known = known_[std::move(digest)];
  std::shared_ptr<SharedPreparation> preparation = known.lock();
  if (preparation == nullptr) {
    preparation = std::make_shared<SharedPreparation>(budget_->AccountOf(record.owner), pool_);
    known = preparation;
  }
  return preparation;
}

}  // namespace tissueform
