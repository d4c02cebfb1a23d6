// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "server/auth/identity.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session.h"
#include "server/store/session_record.h"
#include "tissueform/v1/mesh.pb.h"
#include "tissueform/v1/mesh_service.pb.h"
#include "tissueform/v1/session.pb.h"
#include "tissueform/v1/session_service.pb.h"

// The server's own resources as messages; everything else is converted by proto/conversion.
namespace tissueform {

MeshAnnouncement ToAnnouncement(const v1::MeshHeader& header);
v1::Mesh ToProto(const StoredMesh& mesh);

// The record of a session that `owner` asks for on `mesh`. Errors: those of ToSessionRequest.
absl::StatusOr<SessionRecord> ToSessionRecord(const v1::CreateSessionRequest& request,
                                              const StoredMesh& mesh, const Principal& owner,
                                              const ServiceLimits& limits);
v1::Session ToProto(const Session& session);

}  // namespace tissueform
