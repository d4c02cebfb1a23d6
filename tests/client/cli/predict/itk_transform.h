// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <string>

namespace tissueform::testing {

// Where ITK maps a place by the one transform of a file; not finite where it cannot. Apart from the
// tests, because ITK's transforms bring an Eigen of their own.
std::array<double, 3> MapByItk(const std::string& path, const std::array<double, 3>& place);

}  // namespace tissueform::testing
