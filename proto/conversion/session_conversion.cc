// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/session_conversion.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/io/zero_copy_stream_impl_lite.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/contact_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"

namespace tissueform {
namespace {

constexpr absl::string_view kSessionPrefix = "sessions/";
constexpr size_t kMaxSessionIdBytes = 64;
// An id that a client chooses is all that protects its session from strangers: not too short.
constexpr size_t kMinChosenIdBytes = 16;

// Letters, digits and "-", not too many: fit for a header, a log and a path.
bool IsSessionId(absl::string_view id) {
  return !id.empty() && id.size() <= kMaxSessionIdBytes &&
         std::all_of(id.begin(), id.end(),
                     [](unsigned char c) { return absl::ascii_isalnum(c) || c == '-'; });
}

absl::Status CheckChosenId(absl::string_view id) {
  if (id.empty() || (IsSessionId(id) && id.size() >= kMinChosenIdBytes)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "session_id must be ", kMinChosenIdBytes, " to ", kMaxSessionIdBytes,
      " letters, digits and \"-\", hard to guess; remove it and the server chooses one"));
}

absl::Status ReadStiffness(const v1::Stiffness& stiffness, SessionRequest* request) {
  switch (stiffness.source_case()) {
    case v1::Stiffness::kUniformPa:
      request->stiffness = stiffness.uniform_pa();
      return absl::OkStatus();
    case v1::Stiffness::kCellArray:
      request->stiffness = stiffness.cell_array();
      return absl::OkStatus();
    case v1::Stiffness::SOURCE_NOT_SET:
      break;
  }
  return absl::InvalidArgumentError("stiffness is missing; set uniform_pa or cell_array");
}

absl::Status ReadHandles(const v1::CreateSessionRequest& proto, const SessionRequestLimits& limits,
                         SessionRequest* request) {
  if (proto.handles_size() > limits.max_handles) {
    return absl::InvalidArgumentError(absl::StrCat("the request has ", proto.handles_size(),
                                                   " handles; send ", limits.max_handles,
                                                   " at most"));
  }
  for (const v1::Handle& handle : proto.handles()) {
    const std::string field = absl::StrCat("handle ", request->handles.size());
    if (handle.name().size() > static_cast<size_t>(limits.max_name_bytes)) {
      return absl::InvalidArgumentError(absl::StrCat("name of ", field, " has ",
                                                     handle.name().size(), " bytes; the limit is ",
                                                     limits.max_name_bytes));
    }
    TF_ASSIGN_OR_RETURN(std::vector<int32_t> vertices,
                        ToVertices(handle.vertices(), limits.num_vertices, field));
    request->handles.push_back({handle.name(), std::move(vertices)});
  }
  return absl::OkStatus();
}

}  // namespace

std::string SessionName(absl::string_view id) { return absl::StrCat(kSessionPrefix, id); }

absl::StatusOr<std::string> ParseSessionName(absl::string_view name) {
  if (!absl::ConsumePrefix(&name, kSessionPrefix) || !IsSessionId(name)) {
    return absl::InvalidArgumentError(
        "invalid session name; use the name that CreateSession returned, \"sessions/{id}\"");
  }
  return std::string(name);
}

v1::CreateSessionRequest ToProto(const SessionRequest& request) {
  v1::CreateSessionRequest proto;
  proto.set_mesh(request.mesh);
  if (const double* uniform_pa = std::get_if<double>(&request.stiffness)) {
    proto.mutable_stiffness()->set_uniform_pa(*uniform_pa);
  } else {
    proto.mutable_stiffness()->set_cell_array(std::get<std::string>(request.stiffness));
  }
  proto.mutable_fixed_vertices()->Add(request.fixed.begin(), request.fixed.end());
  for (const HandleRegion& region : request.handles) {
    v1::Handle* handle = proto.add_handles();
    handle->set_name(region.name);
    handle->mutable_vertices()->Add(region.vertices.begin(), region.vertices.end());
  }
  *proto.mutable_contact() = ToProto(request.contact, request.handles);
  if (request.lip_edge) *proto.mutable_lip_edge() = ToProto(*request.lip_edge, request.seals_lips);
  proto.set_model(ToProto(request.model));
  proto.set_poisson_ratio(request.poisson_ratio);
  *proto.mutable_gradient_field() = ToProto(request.gradient_field);
  proto.set_request_id(request.request_id);
  proto.set_session_id(request.session_id);
  return proto;
}

absl::StatusOr<SessionRequest> ToSessionRequest(const v1::CreateSessionRequest& proto,
                                                const SessionRequestLimits& limits) {
  if (proto.request_id().size() > static_cast<size_t>(limits.max_request_id_bytes)) {
    return absl::InvalidArgumentError(absl::StrCat("request_id has ", proto.request_id().size(),
                                                   " bytes; the limit is ",
                                                   limits.max_request_id_bytes));
  }
  TF_RETURN_IF_ERROR(CheckChosenId(proto.session_id()));
  SessionRequest request;
  request.mesh = proto.mesh();
  request.session_id = proto.session_id();
  request.request_id = proto.request_id();
  TF_RETURN_IF_ERROR(ReadStiffness(proto.stiffness(), &request));
  TF_ASSIGN_OR_RETURN(request.model, ToModel(proto.model(), DeformationModel::kGradientField));
  if (proto.has_poisson_ratio()) request.poisson_ratio = proto.poisson_ratio();
  TF_ASSIGN_OR_RETURN(request.gradient_field,
                      ToGradientFieldOptions(proto.gradient_field(), limits.max_iterations));
  TF_ASSIGN_OR_RETURN(request.fixed,
                      ToVertices(proto.fixed_vertices(), limits.num_vertices, "fixed_vertices"));
  TF_RETURN_IF_ERROR(ReadHandles(proto, limits, &request));
  TF_ASSIGN_OR_RETURN(request.contact, ToContactRows(proto.contact(), request.handles));
  if (proto.has_lip_edge()) {
    request.lip_edge = ToLipEdge(proto.lip_edge());
    request.seals_lips = proto.lip_edge().sealed();
  }
  return request;
}

std::string RequestFingerprint(const v1::CreateSessionRequest& request) {
  v1::CreateSessionRequest without_id = request;
  without_id.clear_request_id();
  return MessageFingerprint(without_id);
}

std::string MessageFingerprint(const google::protobuf::MessageLite& message) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream output(&stream);
    output.SetSerializationDeterministic(true);
    message.SerializeToCodedStream(&output);
  }
  return Sha256Hex({bytes});
}

}  // namespace tissueform
