// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/rpc_table.h"

#include "absl/strings/str_cat.h"

#include "proto/services/service_list.h"

namespace tissueform {

std::vector<Rpc> AllRpcs() {
  std::vector<Rpc> rpcs;
  for (const google::protobuf::ServiceDescriptor* service : AllServices()) {
    for (int i = 0; i < service->method_count(); ++i) {
      const google::protobuf::MethodDescriptor& method = *service->method(i);
      rpcs.push_back({.name = absl::StrCat(service->name(), ".", method.name()),
                      .streams = method.client_streaming() || method.server_streaming()});
    }
  }
  return rpcs;
}

}  // namespace tissueform
