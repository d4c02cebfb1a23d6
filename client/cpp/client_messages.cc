// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/client_messages.h"

#include <bit>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

static_assert(std::endian::native == std::endian::little, "answers are little-endian");

void Set(const Eigen::Vector3d& from, v1::Vector3* to) {
  to->set_x(from.x());
  to->set_y(from.y());
  to->set_z(from.z());
}

}  // namespace

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
  proto.set_model(request.model);
  proto.set_poisson_ratio(request.poisson_ratio);
  *proto.mutable_gradient_field() = request.gradient_field;
  proto.set_request_id(request.request_id);
  return proto;
}

v1::HandlePose ToProto(const NamedPose& pose) {
  v1::HandlePose proto;
  proto.set_handle(pose.handle);
  Set(pose.pose.rotation_vector, proto.mutable_rotation_vector());
  Set(pose.pose.pivot_mm, proto.mutable_pivot_mm());
  Set(pose.pose.translation_mm, proto.mutable_translation_mm());
  proto.set_scale(pose.pose.scale);
  return proto;
}

v1::VertexSelection ToProto(const AnswerVertices& vertices) {
  v1::VertexSelection proto;
  switch (vertices.kind) {
    case AnswerVertices::Kind::kAll:
      proto.mutable_all();
      break;
    case AnswerVertices::Kind::kSkin:
      proto.mutable_skin();
      break;
    case AnswerVertices::Kind::kList:
      proto.mutable_list()->mutable_vertices()->Add(vertices.list.begin(), vertices.list.end());
      break;
  }
  return proto;
}

absl::StatusOr<Positions> DecodePositions(const std::string& bytes, int64_t num_vertices) {
  using Float32Positions = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
  if (bytes.size() != static_cast<size_t>(num_vertices) * 3 * sizeof(float)) {
    return absl::InternalError(absl::StrCat("the server answered ", bytes.size(), " bytes for ",
                                            num_vertices, " vertices; it speaks another version"));
  }
  Float32Positions positions(num_vertices, 3);
  std::memcpy(positions.data(), bytes.data(), bytes.size());
  return Positions(positions.cast<double>());
}

}  // namespace tissueform
