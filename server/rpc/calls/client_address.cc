// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/client_address.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_replace.h"
#include "grpcpp/server_context.h"

#include "server/platform/network_address.h"

namespace tissueform {
namespace {

// "ipv4:192.0.2.1:1234", "ipv6:%5B::1%5D:1234" and "unix:" as gRPC says them: without the port.
std::string PeerAddress(const grpc::CallbackServerContext& context) {
  std::string peer = context.peer();
  peer.resize(std::min(peer.rfind(':'), peer.size()));
  return absl::StrReplaceAll(peer.substr(std::min(peer.find(':') + 1, peer.size())),
                             {{"%5B", ""}, {"%5D", ""}});
}

}  // namespace

std::string ClientAddress(const grpc::CallbackServerContext* context,
                          const Credentials& credentials, absl::string_view gateway_name) {
  if (context == nullptr) return {};
  const auto& names = credentials.certificate_names;
  if (!gateway_name.empty() && std::find(names.begin(), names.end(), gateway_name) != names.end()) {
    const auto [begin, end] = context->client_metadata().equal_range(kClientAddressHeader);
    if (begin != end && std::next(begin) == end) {
      const std::string stated = AddressOr({begin->second.data(), begin->second.size()});
      if (!stated.empty()) return stated;
    }
  }
  return PeerAddress(*context);
}

}  // namespace tissueform
