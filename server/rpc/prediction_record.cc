// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/prediction_record.h"

#include <variant>

#include "absl/strings/str_cat.h"

#include "core/base/random_id.h"
#include "core/base/software_version.h"
#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/case_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "tissueform/store/v1/store_records.pb.h"

namespace tissueform {
namespace {

// As long as RandomId, from as many digits of the digest.
constexpr size_t kIdDigits = 32;

void SetSettings(const Session& session, v1::Prediction* prediction) {
  *prediction->mutable_gradient_field() = ToProto(session.gradient_field());
  prediction->set_poisson_ratio(session.poisson_ratio());
  if (const double* uniform_pa = std::get_if<double>(&session.stiffness())) {
    prediction->mutable_stiffness()->set_uniform_pa(*uniform_pa);
  } else {
    prediction->mutable_stiffness()->set_cell_array(std::get<std::string>(session.stiffness()));
  }
  prediction->set_recipe_sha256(RecipeSha256(session));
}

v1::Prediction Describe(const SingleAnswer& answer) {
  const Session& session = *answer.session;
  v1::Prediction prediction;
  for (size_t h = 0; h < answer.poses.size(); ++h) {
    *prediction.add_poses() =
        ToProto(NamedPose{session.constraints().handles()[h].name, answer.poses[h]});
  }
  prediction.set_model(ToProto(answer.model));
  SetSettings(session, &prediction);
  *prediction.mutable_summary() = ToSummaryProto(answer.deformation, answer.model);
  *prediction.mutable_quality() =
      ToProto(MeasureDeformation(session.mesh().mesh, answer.deformation.positions));
  prediction.set_software_version(SoftwareVersion());
  prediction.set_software_commit(SoftwareCommit());
  return prediction;
}

}  // namespace

PredictionRequestKey KeyOf(const Principal& owner, const std::string& request_id,
                           const std::string& fingerprint) {
  if (request_id.empty()) return {.id = RandomId(), .fingerprint = ""};
  // The length keeps owner and id apart.
  const std::string prefix = absl::StrCat("prediction ", owner.name.size(), " ", owner.name, " ");
  return {.id = Sha256Hex({prefix, request_id}).substr(0, kIdDigits), .fingerprint = fingerprint};
}

absl::StatusOr<PredictionNotes> NotesOf(const v1::CreatePredictionRequest& request,
                                        int max_title_bytes) {
  TF_RETURN_IF_ERROR(CheckTitle(request.title(), max_title_bytes));
  PredictionNotes notes{.case_sha256 = "", .title = request.title()};
  if (!request.case_().empty()) {
    TF_ASSIGN_OR_RETURN(notes.case_sha256, ParseCaseName(request.case_()));
  }
  return notes;
}

PredictionToKeep ToKeep(const PredictionRequestKey& key, const Principal& owner, int64_t now_s,
                        const PredictionNotes& notes, const SingleAnswer& answer) {
  const StoredMesh& mesh = answer.session->mesh();
  store::v1::PredictionMetadata metadata;
  *metadata.mutable_prediction() = Describe(answer);
  metadata.mutable_prediction()->set_title(notes.title);
  metadata.set_request_fingerprint(key.fingerprint);
  return {.record = {.id = key.id,
                     .owner = owner.name,
                     .session = answer.session->id(),
                     .mesh_sha256 = mesh.sha256,
                     .case_sha256 = notes.case_sha256,
                     .created_s = now_s,
                     .metadata = metadata.SerializeAsString(),
                     .vertex_count = mesh.mesh.num_vertices()},
          .positions = EncodePositions(answer.deformation.positions, {},
                                       v1::POSITION_ENCODING_FLOAT32, mesh.mesh.positions())
                           .bytes};
}

absl::StatusOr<KeptPrediction> FromRecord(const PredictionRecord& record) {
  store::v1::PredictionMetadata metadata;
  if (!metadata.ParseFromString(record.metadata)) {
    return absl::DataLossError(
        absl::StrCat("prediction \"", record.id, "\" is damaged; create it again"));
  }
  KeptPrediction kept;
  kept.prediction = std::move(*metadata.mutable_prediction());
  kept.prediction.set_name(PredictionName(record.id));
  kept.prediction.set_session(SessionName(record.session));
  kept.prediction.set_mesh(MeshName(record.mesh_sha256));
  if (!record.case_sha256.empty()) kept.prediction.set_case_(CaseName(record.case_sha256));
  kept.prediction.set_vertex_count(record.vertex_count);
  kept.prediction.mutable_create_time()->set_seconds(record.created_s);
  kept.fingerprint = metadata.request_fingerprint();
  return kept;
}

std::string RecipeSha256(const Session& session) {
  SessionRequest recipe;
  recipe.stiffness = session.stiffness();
  recipe.poisson_ratio = session.poisson_ratio();
  recipe.fixed = session.constraints().fixed();
  recipe.handles = session.constraints().handles();
  recipe.contact = session.constraints().contact();
  recipe.lip_edge = session.seal();
  recipe.seals_lips = session.seal().has_value();
  return RequestFingerprint(ToProto(recipe));
}

}  // namespace tissueform
