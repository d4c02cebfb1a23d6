// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/server_choice.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

#include "client/gateway/stable_hash.h"
#include "core/base/error_reason.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxNodeName = 64;
constexpr uint32_t kMaxPort = 65535;

bool IsNodeName(absl::string_view name) {
  const auto allowed = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || absl::StrContains("-_.:", c);
  };
  return !name.empty() && name.size() <= kMaxNodeName &&
         std::all_of(name.begin(), name.end(), allowed);
}

// "unix:/PATH", or something with a port.
bool IsAddress(absl::string_view text) {
  if (absl::StartsWith(text, "unix:")) return true;
  const size_t colon = text.rfind(':');
  uint32_t port = 0;
  return colon != absl::string_view::npos && colon > 0 &&
         absl::SimpleAtoi(text.substr(colon + 1), &port) && port > 0 && port <= kMaxPort;
}

absl::Status WrongNode(absl::string_view why) {
  return WithReason(
      absl::UnavailableError(absl::StrCat("the server that this call names ", why,
                                          "; call again without the header x-tissueform-node")),
      ErrorReason::kWrongNode);
}

}  // namespace

NodeAddress ParseNodeAddress(absl::string_view text) {
  const size_t sign = text.find('=');
  if (sign == absl::string_view::npos || absl::StartsWith(text, "unix:")) {
    return {.address = std::string(text)};
  }
  return {.node = std::string(text.substr(0, sign)), .address = std::string(text.substr(sign + 1))};
}

absl::Status ServerChoice::Check(const std::vector<NodeAddress>& servers) {
  std::set<std::string> names;
  for (const auto& [node, address] : servers) {
    const std::string which = absl::StrCat("--server ", node, node.empty() ? "" : "=", address);
    if (address.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(which, " has no address; give NODE=ADDRESS"));
    }
    if (!IsAddress(address)) {
      return absl::InvalidArgumentError(
          absl::StrCat(which, " is not an address; give HOST:PORT or unix:/PATH"));
    }
    if (node.empty()) continue;
    if (!IsNodeName(node)) {
      return absl::InvalidArgumentError(absl::StrCat(
          which, ": a node name has 1 to 64 letters, digits and \"-_.:\"; give NODE=ADDRESS"));
    }
    if (!names.insert(node).second) {
      return absl::InvalidArgumentError(
          absl::StrCat(which, ": duplicate name; give each server its own"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<size_t>> ServerChoice::Candidates(
    absl::string_view node, const std::function<bool(size_t)>& is_serving) const {
  std::vector<size_t> places(servers_.size());
  std::iota(places.begin(), places.end(), size_t{0});
  if (!node.empty()) {
    for (const size_t place : places) {
      if (servers_[place].node != node) continue;
      if (!is_serving(place)) return WrongNode("accepts no calls now");
      return std::vector<size_t>{place};
    }
    const auto named = [this](size_t place) { return !servers_[place].node.empty(); };
    places.erase(std::remove_if(places.begin(), places.end(), named), places.end());
    if (places.empty()) return WrongNode("is unknown to this gateway");
  }
  std::vector<size_t> serving;
  std::copy_if(places.begin(), places.end(), std::back_inserter(serving), is_serving);
  return serving.empty() ? places : serving;
}

absl::StatusOr<size_t> ServerChoice::Choose(absl::string_view session, absl::string_view node,
                                            const std::function<bool(size_t)>& is_serving) {
  TF_ASSIGN_OR_RETURN(const std::vector<size_t> candidates, Candidates(node, is_serving));
  if (session.empty()) return candidates[turn_++ % candidates.size()];
  const auto hash = [this, session](size_t place) {
    const auto& [name, address] = servers_[place];
    return StableHash(absl::StrCat(session, "\n", name.empty() ? address : name));
  };
  return *std::max_element(candidates.begin(), candidates.end(),
                           [&hash](size_t a, size_t b) { return hash(a) < hash(b); });
}

}  // namespace tissueform
