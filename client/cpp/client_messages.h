// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/types.h"
#include "core/constraints/constraint_set.h"
#include "core/constraints/handle_pose.h"
#include "tissueform/v1/geometry.pb.h"
#include "tissueform/v1/session.pb.h"
#include "tissueform/v1/session_service.pb.h"

// What a client says, in the types of core.
namespace tissueform {

// What a session is to be made from.
struct SessionRequest {
  std::string mesh;                             // "meshes/{sha256}"
  std::variant<double, std::string> stiffness;  // Pa for every tet, or the name of a cell array
  std::vector<int32_t> fixed;
  std::vector<HandleRegion> handles;
  v1::DeformationModel model = v1::DEFORMATION_MODEL_GRADIENT_FIELD;
  double poisson_ratio = 0.45;  // of the elastic models
  v1::GradientFieldSettings gradient_field;
  std::string request_id;  // empty: repeating the call makes another session
};

// Where a handle goes.
struct NamedPose {
  std::string handle;
  HandlePose pose;
};

// Which vertices answers hold.
struct AnswerVertices {
  enum class Kind { kAll, kSkin, kList };

  Kind kind = Kind::kAll;
  std::vector<int32_t> list;  // for kList
};

v1::CreateSessionRequest ToProto(const SessionRequest& request);
v1::HandlePose ToProto(const NamedPose& pose);
v1::VertexSelection ToProto(const AnswerVertices& vertices);

// The positions of an answer, #vertices by 3. Errors: Internal when the bytes are not those of
// `num_vertices` vertices.
absl::StatusOr<Positions> DecodePositions(const std::string& bytes, int64_t num_vertices);

}  // namespace tissueform
