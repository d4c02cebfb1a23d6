// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "absl/strings/str_join.h"
#include "absl/strings/string_view.h"

#include "server/store/postgres_store/postgres_connection.h"

// Lists of names and of records, page by page.
namespace tissueform {

// How many rows are asked for, so that it is known whether there are more.
inline int64_t RowsOfPage(int limit) { return int64_t{limit} + 1; }

// For `= ANY (string_to_array($n, chr(31)))`: names with that separator in them match nothing.
template <typename Names>
std::string PostgresNames(const Names& names) {
  return absl::StrJoin(names, "\x1f");
}

// The records of a page. A damaged row is left out: who asks for it hears so. `name_column` is that
// by which pages follow each other.
template <typename Page, typename Read>
Page ReadPostgresPage(const PostgresRows& rows, int limit, size_t name_column, Read read) {
  Page page;
  for (size_t row = 0; row < rows.size(); ++row) {
    if (row == static_cast<size_t>(limit)) {
      page.next = std::string(rows.Text(row - 1, name_column));
      break;
    }
    auto record = read(rows, row);
    if (record.ok()) page.records.push_back(*std::move(record));
  }
  return page;
}

}  // namespace tissueform
