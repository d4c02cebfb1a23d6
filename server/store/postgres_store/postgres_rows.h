// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/types/span.h"

#include "server/store/sql_database.h"

namespace pqxx {
class binarystring;
class result;
}  // namespace pqxx

namespace tissueform {

// As libpqxx takes parameters, in binary, and gives rows; for postgres_connection.cc.
std::vector<pqxx::binarystring> ToParameters(absl::Span<const SqlValue> values);
SqlRows ToRows(const pqxx::result& result);

}  // namespace tissueform
