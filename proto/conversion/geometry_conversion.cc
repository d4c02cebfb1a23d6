// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/geometry_conversion.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/displacement_codec.h"

namespace tissueform {
namespace {

static_assert(std::endian::native == std::endian::little, "answers are little-endian");

HandlePose ToPose(const v1::HandlePose& pose) {
  return {.rotation_vector = ToVector(pose.rotation_vector()),
          .pivot_mm = ToVector(pose.pivot_mm()),
          .translation_mm = ToVector(pose.translation_mm()),
          .scale = pose.has_scale() ? pose.scale() : 1.0};
}

EncodedPositions Float32(const FloatPositions& positions) {
  return {{reinterpret_cast<const char*>(positions.data()), positions.size() * sizeof(float)}, 0};
}

EncodedPositions Pack(const FloatPositions& displacements) {
  CodedDisplacements coded = EncodeDisplacements(displacements);
  return {std::move(coded.bytes), coded.step_mm};
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

v1::Vector3 ToProto(const Eigen::Vector3d& vector) {
  v1::Vector3 proto;
  proto.set_x(vector.x());
  proto.set_y(vector.y());
  proto.set_z(vector.z());
  return proto;
}

Eigen::Vector3d ToVector(const v1::Vector3& vector) { return {vector.x(), vector.y(), vector.z()}; }

v1::HandlePose ToProto(const NamedPose& pose) {
  v1::HandlePose proto;
  proto.set_handle(pose.handle);
  *proto.mutable_rotation_vector() = ToProto(pose.pose.rotation_vector);
  *proto.mutable_pivot_mm() = ToProto(pose.pose.pivot_mm);
  *proto.mutable_translation_mm() = ToProto(pose.pose.translation_mm);
  proto.set_scale(pose.pose.scale);
  return proto;
}

NamedPose ToNamedPose(const v1::HandlePose& pose) { return {pose.handle(), ToPose(pose)}; }

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

absl::StatusOr<VertexChoice> ToVertexChoice(const v1::VertexSelection& selection,
                                            int64_t num_vertices, absl::Span<const int32_t> skin) {
  switch (selection.selection_case()) {
    case v1::VertexSelection::kAll:
    case v1::VertexSelection::SELECTION_NOT_SET:
      return VertexChoice{};
    case v1::VertexSelection::kSkin:
      return VertexChoice{.all = false, .vertices = {skin.begin(), skin.end()}};
    case v1::VertexSelection::kList:
      break;
  }
  if (selection.list().vertices().empty()) {
    return absl::InvalidArgumentError("vertices.list is empty; name at least one vertex");
  }
  TF_ASSIGN_OR_RETURN(std::vector<int32_t> vertices,
                      ToVertices(selection.list().vertices(), num_vertices, "vertices.list"));
  TF_RETURN_IF_ERROR(CheckDistinctAndInRange(vertices, num_vertices));
  return VertexChoice{.all = false, .vertices = std::move(vertices)};
}

absl::StatusOr<std::vector<int32_t>> ToVertices(
    const google::protobuf::RepeatedField<int32_t>& vertices, int64_t num_vertices,
    absl::string_view field) {
  if (vertices.size() > num_vertices) {
    return absl::InvalidArgumentError(absl::StrCat(field, " lists ", vertices.size(),
                                                   " vertices, but the mesh has ", num_vertices,
                                                   "; name each once"));
  }
  return std::vector<int32_t>(vertices.begin(), vertices.end());
}

absl::Status CheckEncoding(v1::PositionEncoding encoding) {
  if (encoding == v1::POSITION_ENCODING_UNSPECIFIED || encoding == v1::POSITION_ENCODING_FLOAT32 ||
      encoding == v1::POSITION_ENCODING_INT16_ZSTD) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("encoding ", encoding, " is not known to this server; use float32"));
}

EncodedPositions EncodePositions(const Positions& positions, const VertexChoice& choice,
                                 v1::PositionEncoding encoding, const Positions& rest) {
  if (encoding == v1::POSITION_ENCODING_INT16_ZSTD) {
    const FloatPositions moved = choice.all
                                     ? FloatPositions((positions - rest).cast<float>())
                                     : FloatPositions((positions(choice.vertices, Eigen::all) -
                                                       rest(choice.vertices, Eigen::all))
                                                          .cast<float>());
    return Pack(moved);
  }
  return Float32(choice.all ? FloatPositions(positions.cast<float>())
                            : FloatPositions(positions(choice.vertices, Eigen::all).cast<float>()));
}

EncodedPositions EncodePositions(const FloatPositions& chosen, const VertexChoice& choice,
                                 v1::PositionEncoding encoding, const Positions& rest) {
  if (encoding != v1::POSITION_ENCODING_INT16_ZSTD) return Float32(chosen);
  if (choice.all) return Pack((chosen.cast<double>() - rest).cast<float>());
  return Pack((chosen.cast<double>() - rest(choice.vertices, Eigen::all)).cast<float>());
}

absl::StatusOr<Positions> DecodePositions(const std::string& bytes, int64_t num_vertices) {
  if (bytes.size() != static_cast<size_t>(num_vertices) * 3 * sizeof(float)) {
    return absl::InternalError(absl::StrCat("the server answered ", bytes.size(), " bytes for ",
                                            num_vertices,
                                            " vertices; its version differs from the client's"));
  }
  FloatPositions positions(num_vertices, 3);
  std::memcpy(positions.data(), bytes.data(), bytes.size());
  return Positions(positions.cast<double>());
}

absl::StatusOr<Positions> DecodePositions(const std::string& bytes, v1::PositionEncoding encoding,
                                          double step_mm, const Positions& rest) {
  TF_RETURN_IF_ERROR(CheckEncoding(encoding));
  if (encoding != v1::POSITION_ENCODING_INT16_ZSTD) return DecodePositions(bytes, rest.rows());
  TF_ASSIGN_OR_RETURN(const Positions moved, DecodeDisplacements(bytes, step_mm, rest.rows()));
  return Positions(rest + moved);
}

}  // namespace tissueform
