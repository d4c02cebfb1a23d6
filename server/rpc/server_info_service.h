// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "server/rpc/calls/call_scope.h"
#include "tissueform/v1/server_info.grpc.pb.h"

namespace tissueform {

// Limits by name, as ServerInfo has them.
using NamedLimits = std::map<std::string, int64_t>;

// tissueform.v1.ServerInfoService. `gate` must outlive it.
class ServerInfoService final : public v1::ServerInfoService::CallbackService {
 public:
  ServerInfoService(AdmissionControl* gate, const NamedLimits& limits);

  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* context,
                                          const v1::GetServerInfoRequest* request,
                                          v1::ServerInfo* response) override;

 private:
  AdmissionControl* const gate_;
  v1::ServerInfo info_;  // constant
};

}  // namespace tissueform
