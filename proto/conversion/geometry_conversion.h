// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "google/protobuf/repeated_ptr_field.h"

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "tissueform/v1/geometry.pb.h"

// Poses, choices of vertices and positions between messages and core. What comes from outside is
// checked here; errors are InvalidArgument and name the field, unless something else is said.
namespace tissueform {

// Where a handle goes.
struct NamedPose {
  std::string handle;
  HandlePose pose;
};

v1::Vector3 ToProto(const Eigen::Vector3d& vector);
Eigen::Vector3d ToVector(const v1::Vector3& vector);

v1::HandlePose ToProto(const NamedPose& pose);
// The message as it is, unchecked.
NamedPose ToNamedPose(const v1::HandlePose& pose);

// One pose per handle, in the order of the constraints; all poses are legal.
absl::StatusOr<std::vector<HandlePose>> ToPoses(
    const google::protobuf::RepeatedPtrField<v1::HandlePose>& poses,
    const ConstraintSet& constraints);

// Which vertices a client asks for.
struct AnswerVertices {
  enum class Kind { kAll, kSkin, kList };

  Kind kind = Kind::kAll;
  std::vector<int32_t> list;  // for kList
};

v1::VertexSelection ToProto(const AnswerVertices& vertices);

// The same for one mesh: the vertices that an answer holds.
struct VertexChoice {
  bool all = true;
  std::vector<int32_t> vertices;  // in the order of the answer; empty when all
};

absl::StatusOr<VertexChoice> ToVertexChoice(const v1::VertexSelection& selection,
                                            int64_t num_vertices, absl::Span<const int32_t> skin);

// `vertices` as they came. Errors: more than the mesh has.
absl::StatusOr<std::vector<int32_t>> ToVertices(
    const google::protobuf::RepeatedField<int32_t>& vertices, int64_t num_vertices,
    absl::string_view field);

// InvalidArgument for an encoding that is not known here.
absl::Status CheckEncoding(v1::PositionEncoding encoding);

// Positions of an answer as they are sent.
struct EncodedPositions {
  std::string bytes;
  double step_mm = 0;  // of POSITION_ENCODING_INT16_ZSTD
};

// REQUIRES: CheckEncoding is OK; `rest` are the positions of the whole mesh.
EncodedPositions EncodePositions(const Positions& positions, const VertexChoice& choice,
                                 v1::PositionEncoding encoding, const Positions& rest);
// The same of an answer that holds the chosen vertices only.
EncodedPositions EncodePositions(const FloatPositions& chosen, const VertexChoice& choice,
                                 v1::PositionEncoding encoding, const Positions& rest);

// The positions of an answer in POSITION_ENCODING_FLOAT32, #vertices by 3. Errors: Internal when
// the bytes are not those of `num_vertices` vertices.
absl::StatusOr<Positions> DecodePositions(const std::string& bytes, int64_t num_vertices);

// In any encoding; `rest` are the positions of the same vertices in the mesh. Errors: also
// DataLoss (damaged bytes, an invalid step), InvalidArgument (an unknown encoding).
absl::StatusOr<Positions> DecodePositions(const std::string& bytes, v1::PositionEncoding encoding,
                                          double step_mm, const Positions& rest);

}  // namespace tissueform
