// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/string_view.h"

namespace pqxx {
class binarystring;
class result;
}  // namespace pqxx

namespace tissueform {

// A parameter of a statement, sent in binary: a bigint; text or bytea.
using PostgresValue = std::variant<int64_t, absl::string_view>;

// What a statement has answered: rows and columns from 0.
class PostgresRows {
 public:
  using Row = std::vector<std::string>;  // as text; bytea as its bytes; NULL as nothing

  PostgresRows() = default;
  explicit PostgresRows(std::vector<Row> rows) : rows_(std::move(rows)) {}

  size_t size() const { return rows_.size(); }
  bool empty() const { return rows_.empty(); }
  absl::string_view Text(size_t row, size_t column) const { return rows_[row][column]; }
  // 0 for what is no number.
  int64_t Integer(size_t row, size_t column) const;

 private:
  std::vector<Row> rows_;
};

// As libpqxx takes and gives them; for postgres_connection.cc.
std::vector<pqxx::binarystring> ToParameters(std::initializer_list<PostgresValue> values);
PostgresRows ToRows(const pqxx::result& result);

}  // namespace tissueform
