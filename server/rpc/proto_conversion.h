// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "google/protobuf/repeated_ptr_field.h"

#include "core/constraints/constraint_set.h"
#include "core/constraints/handle_pose.h"
#include "core/deformation/deformation_quality.h"
#include "core/deformation/deformer.h"
#include "core/prepared_answers/vertex_response.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session.h"
#include "tissueform/v1/deform_service.pb.h"
#include "tissueform/v1/geometry.pb.h"
#include "tissueform/v1/mesh.pb.h"
#include "tissueform/v1/mesh_service.pb.h"
#include "tissueform/v1/session.pb.h"
#include "tissueform/v1/session_service.pb.h"

// Messages to our types and back. Everything that comes from outside is checked here or by what it
// is given to; errors are InvalidArgument and name the field.
namespace tissueform {

// "meshes/{sha256}" to the digest, "sessions/{id}" to the id.
absl::StatusOr<std::string> ParseMeshName(const std::string& name);
absl::StatusOr<std::string> ParseSessionName(const std::string& name);

MeshAnnouncement ToAnnouncement(const v1::MeshHeader& header);
v1::Mesh ToProto(const StoredMesh& mesh);

// Regions are checked by ConstraintSet, stiffness by the deformer.
absl::StatusOr<SessionSpec> ToSessionSpec(const v1::CreateSessionRequest& request,
                                          std::shared_ptr<const StoredMesh> mesh,
                                          const ServiceLimits& limits);
v1::Session ToProto(const Session& session);

// Equal for equal requests, the request_id apart.
std::string RequestFingerprint(const v1::CreateSessionRequest& request);

// One pose per handle, in the order of the constraints; all poses are legal.
absl::StatusOr<std::vector<HandlePose>> ToPoses(
    const google::protobuf::RepeatedPtrField<v1::HandlePose>& poses,
    const ConstraintSet& constraints);

// The vertices that an answer holds.
struct VertexChoice {
  bool all = true;
  std::vector<int32_t> vertices;  // in the order of the answer; empty when all
};
absl::StatusOr<VertexChoice> ToVertexChoice(const v1::VertexSelection& selection,
                                            const StoredMesh& mesh);

// InvalidArgument for an encoding that this server does not know.
absl::Status CheckEncoding(v1::PositionEncoding encoding);

// POSITION_ENCODING_FLOAT32.
std::string EncodePositions(const Positions& positions, const VertexChoice& choice);
std::string EncodePositions(const FloatPositions& positions);

v1::SolveSummary ToProto(const SolveSummary& summary);
v1::DeformationQuality ToProto(const DeformationQuality& quality);

}  // namespace tissueform
