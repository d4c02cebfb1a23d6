// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "server/platform/metrics_page.h"

namespace tissueform {

// What every program reports about its process, by the names that Prometheus' own libraries use:
// memory, processor time, descriptors and their limit, when it started; and its version, as
// `PREFIX_build_info`.
void AddProcessMetrics(const std::string& prefix, const std::string& version, MetricsPage* page);

}  // namespace tissueform
