// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/proto_conversion.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/io/zero_copy_stream_impl_lite.h"

#include "core/base/status_macros.h"
#include "core/mesh_payload/sha256.h"
#include "server/rpc/model_conversion.h"

namespace tissueform {
namespace {

constexpr absl::string_view kMeshPrefix = "meshes/";
constexpr absl::string_view kSessionPrefix = "sessions/";
constexpr size_t kMaxSessionIdBytes = 64;

// `vertices` as it came, if it is not longer than the mesh has vertices.
absl::StatusOr<std::vector<int32_t>> ToVertices(
    const google::protobuf::RepeatedField<int32_t>& vertices, const StoredMesh& mesh,
    absl::string_view field) {
  if (vertices.size() > mesh.mesh.num_vertices()) {
    return absl::InvalidArgumentError(absl::StrCat(field, " lists ", vertices.size(),
                                                   " vertices, but the mesh has ",
                                                   mesh.mesh.num_vertices(), "; name each once"));
  }
  return std::vector<int32_t>(vertices.begin(), vertices.end());
}

absl::Status ReadStiffness(const v1::Stiffness& stiffness, SessionSpec* spec) {
  switch (stiffness.source_case()) {
    case v1::Stiffness::kUniformPa:
      spec->stiffness = stiffness.uniform_pa();
      return absl::OkStatus();
    case v1::Stiffness::kCellArray:
      spec->stiffness = stiffness.cell_array();
      return absl::OkStatus();
    case v1::Stiffness::SOURCE_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError("stiffness is missing; set uniform_pa or cell_array");
}

absl::Status ReadModel(const v1::CreateSessionRequest& request, const ServiceLimits& limits,
                       SessionSpec* spec) {
  TF_ASSIGN_OR_RETURN(spec->model, ToModel(request.model(), DeformationModel::kGradientField));
  // Checked by the preparation.
  if (request.has_poisson_ratio()) spec->poisson_ratio = request.poisson_ratio();
  TF_ASSIGN_OR_RETURN(spec->gradient_field,
                      ToGradientFieldOptions(request.gradient_field(), limits));
  return absl::OkStatus();
}

absl::Status ReadHandles(const v1::CreateSessionRequest& request, const ServiceLimits& limits,
                         SessionSpec* spec) {
  if (request.handles_size() > limits.max_handles) {
    return absl::InvalidArgumentError(absl::StrCat("the request has ", request.handles_size(),
                                                   " handles; send ", limits.max_handles,
                                                   " at most"));
  }
  for (const v1::Handle& handle : request.handles()) {
    const std::string field = absl::StrCat("handle ", spec->handles.size());
    if (handle.name().size() > static_cast<size_t>(limits.max_name_bytes)) {
      return absl::InvalidArgumentError(absl::StrCat("name of ", field, " has ",
                                                     handle.name().size(), " bytes; it may have ",
                                                     limits.max_name_bytes));
    }
    TF_ASSIGN_OR_RETURN(std::vector<int32_t> vertices,
                        ToVertices(handle.vertices(), *spec->mesh, field));
    spec->handles.push_back({handle.name(), std::move(vertices)});
  }
  return absl::OkStatus();
}

Eigen::Vector3d ToVector(const v1::Vector3& vector) { return {vector.x(), vector.y(), vector.z()}; }

HandlePose ToPose(const v1::HandlePose& pose) {
  return {.rotation_vector = ToVector(pose.rotation_vector()),
          .pivot_mm = ToVector(pose.pivot_mm()),
          .translation_mm = ToVector(pose.translation_mm()),
          .scale = pose.has_scale() ? pose.scale() : 1.0};
}

absl::Status CheckDistinctAndInRange(const std::vector<int32_t>& vertices, int64_t num_vertices) {
  std::vector<bool> seen(num_vertices, false);
  for (const int32_t vertex : vertices) {
    if (vertex < 0 || vertex >= num_vertices) {
      return absl::InvalidArgumentError(absl::StrCat("vertices.list names vertex ", vertex,
                                                     ", but the mesh has 0 to ", num_vertices - 1));
    }
    if (seen[vertex]) {
      return absl::InvalidArgumentError(
          absl::StrCat("vertices.list names vertex ", vertex, " twice; name each once"));
    }
    seen[vertex] = true;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> ParseMeshName(const std::string& name) {
  absl::string_view rest = name;
  if (!absl::ConsumePrefix(&rest, kMeshPrefix) || !IsSha256Hex(rest)) {
    return absl::InvalidArgumentError(
        "not the name of a mesh; it is \"meshes/\" and 64 lower-case hexadecimal digits");
  }
  return std::string(rest);
}

absl::StatusOr<std::string> ParseSessionName(const std::string& name) {
  absl::string_view rest = name;
  if (!absl::ConsumePrefix(&rest, kSessionPrefix) || rest.empty() ||
      rest.size() > kMaxSessionIdBytes ||
      !std::all_of(rest.begin(), rest.end(),
                   [](unsigned char c) { return absl::ascii_isalnum(c); })) {
    return absl::InvalidArgumentError(
        "not the name of a session; use the name that CreateSession returned, \"sessions/{id}\"");
  }
  return std::string(rest);
}

MeshAnnouncement ToAnnouncement(const v1::MeshHeader& header) {
  MeshAnnouncement announcement;
  announcement.shape.num_vertices = header.vertex_count();
  announcement.shape.num_tets = header.tet_count();
  announcement.shape.cell_arrays = {header.cell_arrays().begin(), header.cell_arrays().end()};
  announcement.total_bytes = header.total_bytes();
  announcement.sha256 = header.sha256();
  return announcement;
}

v1::Mesh ToProto(const StoredMesh& mesh) {
  v1::Mesh proto;
  proto.set_name(absl::StrCat(kMeshPrefix, mesh.sha256));
  proto.set_vertex_count(mesh.mesh.num_vertices());
  proto.set_tet_count(mesh.mesh.num_tets());
  for (const CellArray& array : mesh.cell_arrays) {
    proto.add_cell_arrays(array.name);
  }
  proto.set_skin_vertex_count(static_cast<int64_t>(mesh.skin.size()));
  proto.set_bytes_held(mesh.reservation.bytes());
  return proto;
}

absl::StatusOr<SessionSpec> ToSessionSpec(const v1::CreateSessionRequest& request,
                                          std::shared_ptr<const StoredMesh> mesh,
                                          const ServiceLimits& limits) {
  if (request.request_id().size() > static_cast<size_t>(limits.max_request_id_bytes)) {
    return absl::InvalidArgumentError(absl::StrCat("request_id has ", request.request_id().size(),
                                                   " bytes; it may have ",
                                                   limits.max_request_id_bytes));
  }
  SessionSpec spec;
  spec.mesh = std::move(mesh);
  TF_RETURN_IF_ERROR(ReadStiffness(request.stiffness(), &spec));
  TF_RETURN_IF_ERROR(ReadModel(request, limits, &spec));
  TF_ASSIGN_OR_RETURN(spec.fixed,
                      ToVertices(request.fixed_vertices(), *spec.mesh, "fixed_vertices"));
  TF_RETURN_IF_ERROR(ReadHandles(request, limits, &spec));
  return spec;
}

v1::Session ToProto(const Session& session) {
  const ConstraintSet& constraints = session.constraints();
  const PreparationSummary& preparation = session.preparation();
  v1::Session proto;
  proto.set_name(absl::StrCat(kSessionPrefix, session.id()));
  proto.set_mesh(absl::StrCat(kMeshPrefix, session.mesh().sha256));
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
  proto.set_bytes_held(session.bytes_held());
  proto.set_factor_bytes(preparation.factor_bytes);
  proto.mutable_seconds()->set_assemble(preparation.assemble_seconds);
  proto.mutable_seconds()->set_analyse(preparation.analyse_seconds);
  proto.mutable_seconds()->set_factorise(preparation.factorise_seconds);
  proto.mutable_seconds()->set_prepare(preparation.prepare_seconds);
  proto.set_negative_weight_count(preparation.negative_weights);
  proto.set_harmonic_min(preparation.harmonic_min);
  proto.set_harmonic_max(preparation.harmonic_max);
  return proto;
}

std::string RequestFingerprint(const v1::CreateSessionRequest& request) {
  v1::CreateSessionRequest without_id = request;
  without_id.clear_request_id();
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream output(&stream);
    output.SetSerializationDeterministic(true);
    without_id.SerializeToCodedStream(&output);
  }
  return Sha256Hex({bytes});
}

absl::StatusOr<std::vector<HandlePose>> ToPoses(
    const google::protobuf::RepeatedPtrField<v1::HandlePose>& poses,
    const ConstraintSet& constraints) {
  const std::vector<HandleRegion>& handles = constraints.handles();
  if (poses.size() != static_cast<int>(handles.size())) {
    return absl::InvalidArgumentError(absl::StrCat(
        "got ", poses.size(), " poses for ", handles.size(), " handles; send one for each handle"));
  }
  std::vector<HandlePose> result(handles.size());
  std::vector<bool> seen(handles.size(), false);
  for (const v1::HandlePose& proto : poses) {
    const auto found = std::find_if(handles.begin(), handles.end(), [&proto](const auto& handle) {
      return handle.name == proto.handle();
    });
    if (found == handles.end()) {
      return absl::InvalidArgumentError(absl::StrCat("the session has no handle \"", proto.handle(),
                                                     "\"; GetSession lists its handles"));
    }
    const size_t index = found - handles.begin();
    if (seen[index]) {
      return absl::InvalidArgumentError(
          absl::StrCat("handle \"", proto.handle(), "\" has two poses; send one for each handle"));
    }
    seen[index] = true;
    result[index] = ToPose(proto);
    if (const absl::Status status = CheckPose(result[index]); !status.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("handle \"", proto.handle(), "\": ", status.message()));
    }
  }
  return result;
}

absl::StatusOr<VertexChoice> ToVertexChoice(const v1::VertexSelection& selection,
                                            const StoredMesh& mesh) {
  switch (selection.selection_case()) {
    case v1::VertexSelection::kAll:
    case v1::VertexSelection::SELECTION_NOT_SET:
      return VertexChoice{};
    case v1::VertexSelection::kSkin:
      return VertexChoice{.all = false, .vertices = mesh.skin};
    case v1::VertexSelection::kList:
      break;
  }
  if (selection.list().vertices().empty()) {
    return absl::InvalidArgumentError("vertices.list is empty; name at least one vertex");
  }
  TF_ASSIGN_OR_RETURN(std::vector<int32_t> vertices,
                      ToVertices(selection.list().vertices(), mesh, "vertices.list"));
  TF_RETURN_IF_ERROR(CheckDistinctAndInRange(vertices, mesh.mesh.num_vertices()));
  return VertexChoice{.all = false, .vertices = std::move(vertices)};
}

absl::Status CheckEncoding(v1::PositionEncoding encoding) {
  if (encoding == v1::POSITION_ENCODING_UNSPECIFIED || encoding == v1::POSITION_ENCODING_FLOAT32) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("encoding ", encoding, " is not known to this server; use float32"));
}

std::string EncodePositions(const Positions& positions, const VertexChoice& choice) {
  const Eigen::Index count =
      choice.all ? positions.rows() : static_cast<Eigen::Index>(choice.vertices.size());
  FloatPositions encoded(count, 3);
  if (choice.all) {
    encoded = positions.cast<float>();
  } else {
    for (Eigen::Index i = 0; i < count; ++i) {
      encoded.row(i) = positions.row(choice.vertices[i]).cast<float>();
    }
  }
  return EncodePositions(encoded);
}

std::string EncodePositions(const FloatPositions& positions) {
  return {reinterpret_cast<const char*>(positions.data()), positions.size() * sizeof(float)};
}

v1::SolveSummary ToProto(const SolveSummary& summary) {
  v1::SolveSummary proto;
  proto.set_solve_seconds(summary.solve_seconds);
  proto.set_iterations(summary.iterations);
  proto.set_converged(summary.converged);
  proto.set_residual(summary.residual);
  proto.mutable_changes_mm()->Add(summary.changes_mm.begin(), summary.changes_mm.end());
  proto.set_cancelled(summary.cancelled);
  proto.mutable_energies_nj()->Add(summary.energies_nj.begin(), summary.energies_nj.end());
  proto.set_load(summary.load);
  proto.set_prepared(summary.prepared);
  proto.set_error_bound_mm(summary.error_bound_mm);
  return proto;
}

v1::DeformationQuality ToProto(const DeformationQuality& quality) {
  v1::DeformationQuality proto;
  proto.set_inverted_tet_count(quality.inverted_tets);
  proto.set_min_volume_ratio(quality.min_volume_ratio);
  proto.set_max_volume_ratio(quality.max_volume_ratio);
  proto.set_total_volume_ratio(quality.total_volume_ratio);
  proto.set_worst_tet(quality.worst_tet);
  proto.set_max_displacement_mm(quality.max_displacement_mm);
  return proto;
}

}  // namespace tissueform
