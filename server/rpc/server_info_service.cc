// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/server_info_service.h"

#include "absl/status/status.h"

#include "core/base/software_version.h"
#include "core/mechanics/deformation/model.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"

namespace tissueform {
namespace {

void AddModel(const ModelTraits& traits, v1::ServerInfo* info) {
  v1::ModelInfo* proto = info->add_models();
  proto->set_model(ToProto(traits.model));
  proto->set_name(std::string(traits.name));
  proto->set_iterates(traits.iterates);
  proto->set_has_prepared_answers(traits.has_prepared_answers);
  proto->set_has_prepared_contact(traits.has_prepared_contact);
}

// Those that a request may name: conversion decides, not a second list.
void AddEncodings(v1::ServerInfo* info) {
  for (int value = v1::PositionEncoding_MIN; value <= v1::PositionEncoding_MAX; ++value) {
    const auto encoding = static_cast<v1::PositionEncoding>(value);
    if (value != v1::POSITION_ENCODING_UNSPECIFIED && v1::PositionEncoding_IsValid(value) &&
        CheckEncoding(encoding).ok()) {
      info->add_encodings(encoding);
    }
  }
}

}  // namespace

ServerInfoService::ServerInfoService(AdmissionControl* gate, const NamedLimits& limits)
    : gate_(gate) {
  info_.set_version(SoftwareVersion());
  info_.set_commit(SoftwareCommit());
  info_.set_api_version("tissueform.v1");
  for (const auto& [name, value] : limits) {
    v1::ServerLimit* limit = info_.add_limits();
    limit->set_name(name);
    limit->set_value(value);
  }
  for (const ModelTraits& traits : AllModels()) AddModel(traits, &info_);
  AddEncodings(&info_);
}

grpc::ServerUnaryReactor* ServerInfoService::GetServerInfo(
    grpc::CallbackServerContext* context, const v1::GetServerInfoRequest* /*request*/,
    v1::ServerInfo* response) {
  CallScope scope(context, "ServerInfoService.GetServerInfo", CallKind::kMetadata, gate_);
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  if (scope.admission().ok()) {
    *response = info_;
    response->set_draining(gate_->draining());
  }
  reactor->Finish(scope.End(scope.admission()));
  return reactor;
}

}  // namespace tissueform
