// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The same for the files of the command line: reading the options' library and JSON takes longer
// than all that these files hold themselves.

#pragma once

#include "CLI/CLI.hpp"
#include "nlohmann/json.hpp"

#include "cmake/precompiled/library.h"
