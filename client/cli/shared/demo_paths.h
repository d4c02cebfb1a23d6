// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace tissueform {

// A plan that comes with the program, by the name of its folder under tests/data/plans:
// ../share/tissueform/plans/NAME/plan.json seen from this program. Nothing of where it was built is
// compiled in, so that an installed tree may be moved; in a build folder a link is in its place.
//
// Errors: NotFound.
absl::StatusOr<std::string> FindBundledPlan(const std::string& name);

// The plan of the demo: `chosen` unless empty, else the bundled real head.
//
// Errors: NotFound.
absl::StatusOr<std::string> FindDemoPlan(const std::string& chosen);

}  // namespace tissueform
