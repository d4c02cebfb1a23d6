// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "tissueform/v1/session_service.pb.h"

namespace tissueform {

// The header by which a proxy sends the calls of one session to one server: the session's id.
inline constexpr char kSessionHeader[] = "x-tissueform-session";
// The header by which a server of a cluster says its name in every reply, and a client has a proxy
// send the calls of a session to the server that holds it.
inline constexpr char kNodeHeader[] = "x-tissueform-node";

// "sessions/{id}" from the id and back. Errors: InvalidArgument.
std::string SessionName(absl::string_view id);
absl::StatusOr<std::string> ParseSessionName(absl::string_view name);

// What a session is to be made from, as a client says it.
struct SessionRequest {
  std::string mesh;                             // "meshes/{sha256}"
  std::variant<double, std::string> stiffness;  // Pa for every tet, or the name of a cell array
  std::vector<int32_t> fixed;
  std::vector<HandleRegion> handles;
  std::vector<ContactRow> contact;  // empty: tissue sticks to bone
  std::optional<LipEdge> lip_edge;  // that a seal may hold together
  bool seals_lips = false;          // it does
  DeformationModel model = DeformationModel::kGradientField;
  double poisson_ratio = 0.45;          // of the elastic models
  GradientFieldOptions gradient_field;  // what belongs to the server is not sent
  std::string request_id;               // empty: repeating the call makes another session
  std::string session_id;               // empty: the server chooses
};

// What a request may hold.
struct SessionRequestLimits {
  int64_t num_vertices = 0;  // of its mesh
  int max_handles = 256;
  int max_name_bytes = 128;
  int max_request_id_bytes = 64;
  int max_iterations = 1000;
};

v1::CreateSessionRequest ToProto(const SessionRequest& request);

// Errors: InvalidArgument, naming the field, for what is missing, unknown or over a limit. Regions
// are checked by ConstraintSet, stiffness and numbers by the deformer.
absl::StatusOr<SessionRequest> ToSessionRequest(const v1::CreateSessionRequest& proto,
                                                const SessionRequestLimits& limits);

// Equal for equal requests, the request_id apart.
std::string RequestFingerprint(const v1::CreateSessionRequest& request);

// SHA-256 of a message, in 64 hexadecimal digits; equal for equal messages.
std::string MessageFingerprint(const google::protobuf::MessageLite& message);

}  // namespace tissueform
