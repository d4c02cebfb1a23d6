// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/calls/client_address.h"

#include <algorithm>
#include <array>

#include "absl/strings/str_replace.h"
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

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

std::string AddressOr(absl::string_view text) {
  if (text.size() >= INET6_ADDRSTRLEN) return {};
  const std::string copy(text);
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  for (const int family : {AF_INET, AF_INET6}) {
    if (inet_pton(family, copy.c_str(), bytes.data()) != 1) continue;
    std::array<char, INET6_ADDRSTRLEN> written{};
    const char* same = inet_ntop(family, bytes.data(), written.data(), written.size());
    return same == nullptr ? "" : same;
  }
  return {};
}

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
