// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

#include "core/mechanics/deformation/model.h"
#include "core/mechanics/uncertainty/material_uncertainty.h"
#include "server/access/auth/identity.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session.h"
#include "server/session/session_registry.h"
#include "server/store/session_record.h"
#include "server/store/upload_store.h"
#include "tissueform/v1/deform_service.pb.h"
#include "tissueform/v1/mesh.pb.h"
#include "tissueform/v1/mesh_service.pb.h"
#include "tissueform/v1/session.pb.h"
#include "tissueform/v1/session_service.pb.h"

// The server's own resources as messages; everything else is converted by proto/conversion.
namespace tissueform {

UploadAnnouncement ToAnnouncement(const v1::MeshHeader& header);
v1::Mesh ToProto(const MeshView& view);

// The record of a session that `owner` asks for on `mesh`. Errors: those of ToSessionRequest.
absl::StatusOr<SessionRecord> ToSessionRecord(const v1::CreateSessionRequest& request,
                                              const StoredMesh& mesh, const Principal& owner,
                                              const ServiceLimits& limits);
// Errors (InvalidArgument): it changes nothing.
absl::Status CheckNamesSomething(const v1::UpdateSessionRequest& request);
// The record with what the request names. Errors: those of ToSessionRequest.
absl::StatusOr<SessionRecord> ToUpdatedRecord(const v1::UpdateSessionRequest& request,
                                              SessionRecord record, const StoredMesh& mesh,
                                              const ServiceLimits& limits);
v1::Session ToProto(const SessionView& view);

// For answers of `model`. Errors: those of ToMaterialUncertainty; InvalidArgument (not elastic).
absl::StatusOr<MaterialUncertainty> ToElasticRanges(const v1::MaterialRanges& ranges,
                                                    const Session& session, DeformationModel model);

// Which part of a list is asked for.
struct PageRequest {
  int size = 100;
  std::string after;  // names greater than this
};
// Errors: InvalidArgument.
absl::StatusOr<PageRequest> ReadPageRequest(int32_t page_size, const std::string& page_token);

}  // namespace tissueform
