// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace tissueform {

// Translates a statement of sql_database.h for SQLite.
std::string ToSqlite(absl::string_view sql);

}  // namespace tissueform
