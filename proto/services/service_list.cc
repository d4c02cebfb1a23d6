// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/services/service_list.h"

#include "tissueform/v1/access_service.pb.h"
#include "tissueform/v1/case_service.pb.h"
#include "tissueform/v1/deform_service.pb.h"
#include "tissueform/v1/export_service.pb.h"
#include "tissueform/v1/mesh_service.pb.h"
#include "tissueform/v1/plan_build_service.pb.h"
#include "tissueform/v1/plan_service.pb.h"
#include "tissueform/v1/prediction_service.pb.h"
#include "tissueform/v1/server_info.pb.h"
#include "tissueform/v1/session_service.pb.h"

namespace tissueform {
namespace {

std::vector<const google::protobuf::ServiceDescriptor*> FindServices() {
  // One message of each file. The linker drops the descriptors of files that nothing refers to.
  const google::protobuf::Descriptor* const messages[] = {
      v1::WhoAmIRequest::descriptor(),        v1::GetCaseRequest::descriptor(),
      v1::DeformRequest::descriptor(),        v1::GetExportRequest::descriptor(),
      v1::GetMeshRequest::descriptor(),       v1::GetPlanBuildRequest::descriptor(),
      v1::FitRequest::descriptor(),           v1::GetPredictionRequest::descriptor(),
      v1::GetServerInfoRequest::descriptor(), v1::GetSessionRequest::descriptor()};
  std::vector<const google::protobuf::ServiceDescriptor*> services;
  for (const google::protobuf::Descriptor* message : messages) {
    for (int i = 0; i < message->file()->service_count(); ++i) {
      services.push_back(message->file()->service(i));
    }
  }
  return services;
}

}  // namespace

const std::vector<const google::protobuf::ServiceDescriptor*>& AllServices() {
  static const auto& services =
      *new std::vector<const google::protobuf::ServiceDescriptor*>(FindServices());
  return services;
}

}  // namespace tissueform
