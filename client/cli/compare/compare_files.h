// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "client/cli/compare/comparison_report.h"

namespace tissueform {

// Compares two results of one mesh, vertex by vertex: over all, over the skin and for each value of
// a point array of A.
absl::Status CompareFiles(const CompareOptions& options);

}  // namespace tissueform
