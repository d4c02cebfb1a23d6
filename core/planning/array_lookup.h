// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mesh/attribute.h"

namespace tissueform {

// The values of the one-component array `name`. `kind` is "point" or "cell".
//
// Errors: InvalidArgument when there is no such array (the message lists those that there are) or
// when it has more than one component.
absl::StatusOr<std::vector<double>> FindScalars(const std::vector<Attribute>& attributes,
                                                const std::string& name, const std::string& kind);

}  // namespace tissueform
