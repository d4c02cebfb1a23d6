// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/resource_conversion.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/material_conversion.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {

namespace {

constexpr int kPageSize = 100;
constexpr int kMaxPageSize = 1000;
constexpr size_t kMaxPageTokenBytes = 128;

SessionRequestLimits RequestLimits(const StoredMesh& mesh, const ServiceLimits& limits) {
  return {.num_vertices = mesh.mesh.num_vertices(),
          .max_handles = limits.max_handles,
          .max_name_bytes = limits.max_name_bytes,
          .max_request_id_bytes = limits.max_request_id_bytes,
          .max_iterations = limits.max_iterations};
}

// What a session is made from on its mesh.
void SetRecipe(SessionRequest request, SessionRecord* record) {
  record->stiffness = std::move(request.stiffness);
  record->fixed = std::move(request.fixed);
  record->handles = std::move(request.handles);
  record->contact = std::move(request.contact);
  record->lip_edge = std::move(request.lip_edge);
  record->seals_lips = request.seals_lips;
  record->model = request.model;
  record->poisson_ratio = request.poisson_ratio;
  record->gradient_field = request.gradient_field;
}

void AddPreparation(const Session& session, v1::Session* proto) {
  const int64_t num_vertices = session.mesh().mesh.num_vertices();
  const ConstraintSet& constraints = session.constraints();
  proto->set_vertex_count(num_vertices);
  proto->set_tet_count(session.mesh().mesh.num_tets());
  proto->set_fixed_vertex_count(static_cast<int64_t>(constraints.fixed().size()));
  proto->set_free_vertex_count(num_vertices -
                               static_cast<int64_t>(constraints.constrained().size()));
  SetPreparation(session.preparation(), proto);
  proto->set_bytes_held(session.bytes_held());
  proto->set_shared_bytes(session.shared_bytes());
}

}  // namespace

UploadAnnouncement ToAnnouncement(const v1::MeshHeader& header) {
  return {ToPayloadShape(header), header.total_bytes(), header.sha256()};
}

v1::Mesh ToProto(const MeshView& view) {
  const MeshRecord& record = view.record;
  v1::Mesh proto;
  proto.set_name(MeshName(record.sha256));
  proto.set_vertex_count(record.shape.num_vertices);
  proto.set_tet_count(record.shape.num_tets);
  for (const std::string& name : record.shape.cell_arrays) {
    proto.add_cell_arrays(name);
  }
  proto.set_skin_vertex_count(record.skin_vertex_count);
  if (view.mesh != nullptr) proto.set_bytes_held(view.mesh->reservation.bytes());
  return proto;
}

absl::StatusOr<SessionRecord> ToSessionRecord(const v1::CreateSessionRequest& request,
                                              const StoredMesh& mesh, const Principal& owner,
                                              const ServiceLimits& limits) {
  TF_ASSIGN_OR_RETURN(SessionRequest checked,
                      ToSessionRequest(request, RequestLimits(mesh, limits)));
  SessionRecord record;
  record.id = std::move(checked.session_id);
  record.owner = owner.name;
  record.project = request.project();
  record.mesh_sha256 = mesh.sha256;
  record.request_id = std::move(checked.request_id);
  record.request_fingerprint = RequestFingerprint(request);
  SetRecipe(std::move(checked), &record);
  return record;
}

absl::Status CheckNamesSomething(const v1::UpdateSessionRequest& request) {
  if (request.has_stiffness() || request.has_regions() || request.has_gradient_field() ||
      request.has_poisson_ratio() || request.model() != v1::DEFORMATION_MODEL_UNSPECIFIED) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "the request changes nothing; set stiffness, regions, model, gradient_field or "
      "poisson_ratio");
}

// Through the same checks as a new one.
absl::StatusOr<SessionRecord> ToUpdatedRecord(const v1::UpdateSessionRequest& request,
                                              SessionRecord record, const StoredMesh& mesh,
                                              const ServiceLimits& limits) {
  SessionRequest before;
  before.stiffness = record.stiffness;
  before.fixed = record.fixed;
  before.handles = record.handles;
  before.contact = record.contact;
  before.lip_edge = record.lip_edge;
  before.seals_lips = record.seals_lips;
  before.model = record.model;
  before.poisson_ratio = record.poisson_ratio;
  before.gradient_field = record.gradient_field;
  v1::CreateSessionRequest merged = ToProto(before);
  if (request.has_stiffness()) *merged.mutable_stiffness() = request.stiffness();
  if (request.has_regions()) {
    *merged.mutable_fixed_vertices() = request.regions().fixed_vertices();
    *merged.mutable_handles() = request.regions().handles();
    *merged.mutable_contact() = request.regions().contact();
    merged.clear_lip_edge();
    if (request.regions().has_lip_edge()) {
      *merged.mutable_lip_edge() = request.regions().lip_edge();
    }
  }
  if (request.model() != v1::DEFORMATION_MODEL_UNSPECIFIED) merged.set_model(request.model());
  if (request.has_gradient_field()) *merged.mutable_gradient_field() = request.gradient_field();
  if (request.has_poisson_ratio()) merged.set_poisson_ratio(request.poisson_ratio());
  TF_ASSIGN_OR_RETURN(SessionRequest checked,
                      ToSessionRequest(merged, RequestLimits(mesh, limits)));
  SetRecipe(std::move(checked), &record);
  return record;
}

absl::StatusOr<PageRequest> ReadPageRequest(int32_t page_size, const std::string& page_token) {
  if (page_size < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("page_size is ", page_size, "; it must be 0 (the server chooses) or more"));
  }
  if (page_token.size() > kMaxPageTokenBytes) {
    return absl::InvalidArgumentError(
        "invalid page_token; use next_page_token of the previous page");
  }
  return PageRequest{.size = page_size == 0 ? kPageSize : std::min(page_size, kMaxPageSize),
                     .after = page_token};
}

absl::StatusOr<MaterialUncertainty> ToElasticRanges(const v1::MaterialRanges& ranges,
                                                    const Session& session,
                                                    DeformationModel model) {
  TF_ASSIGN_OR_RETURN(
      MaterialUncertainty uncertainty,
      ToMaterialUncertainty(ranges, session.mesh().mesh.num_tets(), session.poisson_ratio()));
  if (!TraitsOf(model).is_elastic) {
    return absl::InvalidArgumentError(
        "ranges need linear_elastic or neo_hookean; choose one of them, or leave them out");
  }
  return uncertainty;
}

v1::Session ToProto(const SessionView& view) {
  const SessionRecord& record = view.record;
  v1::Session proto;
  proto.set_name(SessionName(record.id));
  proto.set_mesh(MeshName(record.mesh_sha256));
  proto.set_model(ToProto(record.model));
  proto.set_poisson_ratio(record.poisson_ratio);
  *proto.mutable_gradient_field() = ToProto(record.gradient_field);
  proto.set_fixed_vertex_count(static_cast<int64_t>(record.fixed.size()));
  for (size_t h = 0; h < record.handles.size(); ++h) {
    proto.add_handles(record.handles[h].name);
    proto.add_handle_vertex_counts(static_cast<int64_t>(record.handles[h].vertices.size()));
    if (!record.last_poses.empty()) {
      *proto.add_committed_poses() =
          ToProto(NamedPose{record.handles[h].name, record.last_poses[h]});
    }
  }
  proto.set_contact_row_count(static_cast<int64_t>(record.contact.size()));
  if (record.seals_lips) {
    proto.set_sealed_pair_count(static_cast<int64_t>(record.lip_edge->pairs.size()));
  }
  proto.set_state(view.session == nullptr ? v1::SESSION_STATE_STORED : v1::SESSION_STATE_READY);
  proto.set_etag(record.etag);
  proto.mutable_create_time()->set_seconds(record.created_s);
  proto.mutable_last_use_time()->set_seconds(record.last_used_s);
  if (view.session != nullptr) AddPreparation(*view.session, &proto);
  return proto;
}

}  // namespace tissueform
