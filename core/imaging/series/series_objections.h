// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "core/imaging/series/series_facts.h"
#include "core/imaging/series/series_rules.h"

namespace tissueform {

// Why a rule does not take a series, all that is against it; empty: it takes it. For other
// modalities what they lack: "MR has no Hounsfield units ...".
std::string WhatIsAgainst(const SeriesFacts& series, const SeriesRule& rule);

}  // namespace tissueform
