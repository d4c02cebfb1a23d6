// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/rpc_table.h"

#include "absl/strings/str_cat.h"
#include "google/protobuf/descriptor.h"

#include "tissueform/v1/access_service.pb.h"
#include "tissueform/v1/case_service.pb.h"
#include "tissueform/v1/deform_service.pb.h"
#include "tissueform/v1/export_service.pb.h"
#include "tissueform/v1/mesh_service.pb.h"
#include "tissueform/v1/plan_service.pb.h"
#include "tissueform/v1/prediction_service.pb.h"
#include "tissueform/v1/server_info.pb.h"
#include "tissueform/v1/session_service.pb.h"

namespace tissueform {

std::vector<Rpc> AllRpcs() {
  // A file each: descriptors of files that nobody names are left out by the linker.
  const google::protobuf::Descriptor* const messages[] = {
      v1::WhoAmIRequest::descriptor(),        v1::GetCaseRequest::descriptor(),
      v1::DeformRequest::descriptor(),        v1::GetExportRequest::descriptor(),
      v1::GetMeshRequest::descriptor(),       v1::FitRequest::descriptor(),
      v1::GetPredictionRequest::descriptor(), v1::GetServerInfoRequest::descriptor(),
      v1::GetSessionRequest::descriptor()};
  std::vector<Rpc> rpcs;
  for (const google::protobuf::Descriptor* message : messages) {
    const google::protobuf::FileDescriptor& file = *message->file();
    for (int i = 0; i < file.service_count(); ++i) {
      for (int j = 0; j < file.service(i)->method_count(); ++j) {
        const google::protobuf::MethodDescriptor& method = *file.service(i)->method(j);
        rpcs.push_back({.name = absl::StrCat(file.service(i)->name(), ".", method.name()),
                        .streams = method.client_streaming() || method.server_streaming()});
      }
    }
  }
  return rpcs;
}

}  // namespace tissueform
