// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/allowed_resource.h"

#include "core/base/status_macros.h"
#include "proto/conversion/case_conversion.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {

absl::StatusOr<std::string> AllowedSession(Access* access, CallScope* scope,
                                           const std::string& name, Permission need) {
  TF_ASSIGN_OR_RETURN(std::string id, ParseSessionName(name));
  TF_ASSIGN_OR_RETURN(const Access::Found found,
                      access->CheckSessionAccess(scope->principal(), id, need));
  // The name of a resource that does not exist is only the client's text, and goes to no log.
  if (found == Access::Found::kYes) scope->SetResource(name);
  return id;
}

absl::StatusOr<std::string> AllowedPrediction(Access* access, CallScope* scope,
                                              const std::string& name, Permission need) {
  TF_ASSIGN_OR_RETURN(std::string id, ParsePredictionName(name));
  TF_ASSIGN_OR_RETURN(const Access::Found found,
                      access->CheckPredictionAccess(scope->principal(), id, need));
  if (found == Access::Found::kYes) scope->SetResource(name);
  return id;
}

absl::StatusOr<std::string> AllowedMesh(Access* access, CallScope* scope, const std::string& name,
                                        Permission need) {
  TF_ASSIGN_OR_RETURN(std::string sha256, ParseMeshName(name));
  TF_RETURN_IF_ERROR(access->CheckMeshAccess(scope->principal(), sha256, need));
  scope->SetResource(name);
  return sha256;
}

absl::StatusOr<CaseKey> AllowedCase(Access* access, CallScope* scope, const std::string& name,
                                    Permission need) {
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseCaseName(name));
  TF_ASSIGN_OR_RETURN(CaseKey key, access->CheckCaseAccess(scope->principal(), sha256, need));
  scope->SetResource(name);
  return key;
}

}  // namespace tissueform
