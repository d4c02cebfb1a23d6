// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>

#include "client/cli/doctor/doctor_report.h"
#include "client/cpp/connection_options.h"

namespace tissueform {

// What the token of the options says of itself: whose it is and how long it lasts. Only a server
// can decide whether it is valid; this check does not verify its signature, and prints only claims
// of the token.
DoctorLine CheckToken(const ConnectionOptions& options, std::chrono::system_clock::time_point now);

}  // namespace tissueform
