// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

namespace tissueform {

// OK where a program can listen on 127.0.0.1:`port` now; always of port 0, which takes a free one.
// `option` is what the user chose the port with.
//
// Errors: Unavailable, naming port, reason and option.
absl::Status CheckLoopbackPort(int port, const std::string& option);

}  // namespace tissueform
