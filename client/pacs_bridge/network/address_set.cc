// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/address_set.h"

#include <algorithm>
#include <optional>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include <arpa/inet.h>
#include <netinet/in.h>

namespace tissueform {
namespace {

std::optional<uint32_t> BitsOf(const std::string& text) {
  in_addr address = {};
  if (inet_pton(AF_INET, text.c_str(), &address) != 1) return {};
  return ntohl(address.s_addr);
}

}  // namespace

absl::StatusOr<AddressSet> AddressSet::Parse(const std::vector<std::string>& texts) {
  AddressSet set;
  for (const std::string& text : texts) {
    const std::vector<std::string> parts = absl::StrSplit(text, absl::MaxSplits('/', 1));
    const std::optional<uint32_t> bits = BitsOf(parts[0]);
    int length = 32;
    if (!bits || (parts.size() == 2 &&
                  (!absl::SimpleAtoi(parts[1], &length) || length < 0 || length > 32))) {
      return absl::InvalidArgumentError(absl::StrCat(
          "'", text, "' is not an IPv4 address or network; write 10.1.2.3 or 10.1.2.0/24"));
    }
    const uint32_t mask = length == 0 ? 0 : ~uint32_t{0} << (32 - length);
    set.networks_.push_back({*bits & mask, mask});
  }
  return set;
}

bool AddressSet::Contains(const std::string& address) const {
  const std::optional<uint32_t> bits = BitsOf(address);
  return bits && std::any_of(networks_.begin(), networks_.end(), [&](const Network& network) {
           return (*bits & network.mask) == network.bits;
         });
}

}  // namespace tissueform
