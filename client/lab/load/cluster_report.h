// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "nlohmann/json.hpp"

#include "client/lab/load/cluster_load.h"

namespace tissueform {

// A table of the nodes, and lines on poses, commits, followers and errors.
std::string ClusterLoadText(const ClusterLoadOptions& options, const ClusterLoadResult& result);

// With where it was measured.
nlohmann::ordered_json ClusterLoadJson(const ClusterLoadOptions& options,
                                       const ClusterLoadResult& result);

}  // namespace tissueform
