// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_database.h"

#include <algorithm>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace tissueform {

int64_t SqlRows::Integer(size_t row, size_t column) const {
  int64_t number = 0;
  return absl::SimpleAtoi(rows_[row][column], &number) ? number : 0;
}

void AddSqlName(absl::string_view name, std::string* list) {
  const bool plain = std::none_of(name.begin(), name.end(), [](char letter) {
    return letter == '"' || letter == '\\' || (letter >= 0 && letter < ' ');
  });
  if (plain) absl::StrAppend(list, list->empty() ? "" : "\x1f", name);
}

}  // namespace tissueform
