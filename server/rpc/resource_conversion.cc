// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/resource_conversion.h"

#include <utility>

#include "core/base/status_macros.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {

MeshAnnouncement ToAnnouncement(const v1::MeshHeader& header) {
  return {ToPayloadShape(header), header.total_bytes(), header.sha256()};
}

v1::Mesh ToProto(const StoredMesh& mesh) {
  v1::Mesh proto;
  proto.set_name(MeshName(mesh.sha256));
  proto.set_vertex_count(mesh.mesh.num_vertices());
  proto.set_tet_count(mesh.mesh.num_tets());
  for (const CellArray& array : mesh.cell_arrays) {
    proto.add_cell_arrays(array.name);
  }
  proto.set_skin_vertex_count(static_cast<int64_t>(mesh.skin.size()));
  proto.set_bytes_held(mesh.reservation.bytes());
  return proto;
}

absl::StatusOr<SessionRecord> ToSessionRecord(const v1::CreateSessionRequest& request,
                                              const StoredMesh& mesh, const Principal& owner,
                                              const ServiceLimits& limits) {
  TF_ASSIGN_OR_RETURN(
      SessionRequest checked,
      ToSessionRequest(request, {.num_vertices = mesh.mesh.num_vertices(),
                                 .max_handles = limits.max_handles,
                                 .max_name_bytes = limits.max_name_bytes,
                                 .max_request_id_bytes = limits.max_request_id_bytes,
                                 .max_iterations = limits.max_iterations}));
  SessionRecord record;
  record.id = std::move(checked.session_id);
  record.owner = owner.name;
  record.mesh_sha256 = mesh.sha256;
  record.stiffness = std::move(checked.stiffness);
  record.fixed = std::move(checked.fixed);
  record.handles = std::move(checked.handles);
  record.model = checked.model;
  record.poisson_ratio = checked.poisson_ratio;
  record.gradient_field = checked.gradient_field;
  record.request_id = std::move(checked.request_id);
  record.request_fingerprint = RequestFingerprint(request);
  return record;
}

v1::Session ToProto(const Session& session) {
  const ConstraintSet& constraints = session.constraints();
  v1::Session proto;
  proto.set_name(SessionName(session.id()));
  proto.set_mesh(MeshName(session.mesh().sha256));
  proto.set_model(ToProto(session.model()));
  proto.set_poisson_ratio(session.poisson_ratio());
  *proto.mutable_gradient_field() = ToProto(session.gradient_field());
  proto.set_vertex_count(session.mesh().mesh.num_vertices());
  proto.set_tet_count(session.mesh().mesh.num_tets());
  proto.set_fixed_vertex_count(static_cast<int64_t>(constraints.fixed().size()));
  proto.set_free_vertex_count(session.mesh().mesh.num_vertices() -
                              static_cast<int64_t>(constraints.constrained().size()));
  for (const HandleRegion& handle : constraints.handles()) {
    proto.add_handles(handle.name);
    proto.add_handle_vertex_counts(static_cast<int64_t>(handle.vertices.size()));
  }
  SetPreparation(session.preparation(), &proto);
  proto.set_bytes_held(session.bytes_held());
  proto.set_shared_bytes(session.shared_bytes());
  return proto;
}

}  // namespace tissueform
