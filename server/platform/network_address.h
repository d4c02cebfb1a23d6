// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace tissueform {

// The header in which the gateway states from where a call has come to it: an address without a
// port.
inline constexpr char kClientAddressHeader[] = "x-tissueform-client-address";

// "192.0.2.1" or "2001:db8::1", in one form for each; empty when the text is no address.
std::string AddressOr(absl::string_view text);

// Whether all addresses of a host are this machine's own; false also when it has none. Asks for the
// name.
bool IsLoopback(const std::string& host);

}  // namespace tissueform
