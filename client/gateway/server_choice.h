// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// A server as --server names it.
struct NodeAddress {
  std::string node = {};  // its name in a cluster; empty: not told
  std::string address;    // as gRPC has addresses
};

// Of "[NODE=]ADDRESS"; what stands before the "=" of a unix socket's path is no name.
NodeAddress ParseNodeAddress(absl::string_view text);

// Which of several servers a call goes to. Thread-safe.
class ServerChoice {
 public:
  // At least one.
  explicit ServerChoice(std::vector<NodeAddress> servers) : servers_(std::move(servers)) {}

  // Error: InvalidArgument: a name is none (1 to 64 letters, digits and "-_.:"), stands twice, or
  // has no address.
  static absl::Status Check(const std::vector<NodeAddress>& servers);

  const std::vector<NodeAddress>& servers() const { return servers_; }

  // The place of a server. `node` (empty: the call names none) is strict: that server, or an error.
  // Servers without a name are asked for every node that has none of the names: they may be proxies
  // that know it, and say WRONG_NODE themselves. Otherwise a `session` stays with the same one of
  // those that serve, whichever gateway is asked (rendezvous hashing); calls without one go to them
  // in turn. Where none serves it is chosen among all, and the server's own answer counts.
  //
  // Error: Unavailable, WRONG_NODE: no server has that name, or it does not serve.
  absl::StatusOr<size_t> Choose(absl::string_view session, absl::string_view node,
                                const std::function<bool(size_t)>& is_serving);

 private:
  absl::StatusOr<std::vector<size_t>> Candidates(
      absl::string_view node, const std::function<bool(size_t)>& is_serving) const;

  // Constant.
  const std::vector<NodeAddress> servers_;

  // Self-synchronised.
  std::atomic<uint64_t> turn_ = 0;
};

}  // namespace tissueform
