// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/network_address.h"

#include <array>
#include <memory>
#include <netdb.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace tissueform {
namespace {

bool IsOwnAddress(const sockaddr& address) {
  if (address.sa_family == AF_INET) {
    const auto& ipv4 = reinterpret_cast<const sockaddr_in&>(address);
    return (ntohl(ipv4.sin_addr.s_addr) >> 24) == 127;
  }
  if (address.sa_family != AF_INET6) return false;
  const auto& ipv6 = reinterpret_cast<const sockaddr_in6&>(address);
  return IN6_IS_ADDR_LOOPBACK(&ipv6.sin6_addr) != 0;
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

bool IsLoopback(const std::string& host) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), nullptr, &hints, &found) != 0) return false;
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> addresses(found, &freeaddrinfo);
  for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
    if (!IsOwnAddress(*address->ai_addr)) return false;
  }
  return found != nullptr;
}

}  // namespace tissueform
