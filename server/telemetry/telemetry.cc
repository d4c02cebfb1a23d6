// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/telemetry.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<Telemetry>> Telemetry::Start(const TelemetryOptions& /*options*/) {
  return std::unique_ptr<Telemetry>(new Telemetry);
}

}  // namespace tissueform
