// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/cohort_list.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"
#include "core/planning/outcome/deviations.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxLineBytes = 64 * 1024;

struct Column {
  const char* name;
  std::string CohortCase::*field;
  bool required;
  bool is_path;
};

constexpr std::array<Column, 8> kColumns = {{{"case", &CohortCase::id, true, false},
                                             {"operation", &CohortCase::operation, true, false},
                                             {"pre", &CohortCase::pre, true, true},
                                             {"post", &CohortCase::post, true, true},
                                             {"post_bone", &CohortCase::post_bone, false, true},
                                             {"post_labels", &CohortCase::post_labels, false, true},
                                             {"post_recipe", &CohortCase::post_recipe, false, true},
                                             {"post_axes", &CohortCase::post_axes, false, false}}};

std::string KnownColumns() {
  return absl::StrJoin(kColumns, ", ", [](std::string* out, const Column& c) { *out += c.name; });
}

absl::Status AtLine(size_t line, const std::string& message) {
  return absl::InvalidArgumentError(absl::StrCat("cohort list: line ", line, ": ", message));
}

// The cells of a line of RFC 4180, without the spaces around them; nothing when a quotation mark is
// not closed.
std::optional<std::vector<std::string>> CellsOf(absl::string_view line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') {
      const bool is_doubled = quoted && i + 1 < line.size() && line[i + 1] == '"';
      if (is_doubled)
        cells.back() += line[i++];
      else
        quoted = !quoted;
    } else if (line[i] == ',' && !quoted) {
      cells.emplace_back();
    } else {
      cells.back() += line[i];
    }
  }
  if (quoted) return std::nullopt;
  for (std::string& cell : cells) absl::StripAsciiWhitespace(&cell);
  return cells;
}

absl::StatusOr<std::vector<const Column*>> ReadHeader(const std::vector<std::string>& names,
                                                      size_t line) {
  std::vector<const Column*> columns;
  columns.reserve(names.size());
  for (size_t n = 0; n < names.size(); ++n) {
    const auto* found = std::ranges::find_if(
        kColumns, [&](const Column& column) { return names[n] == column.name; });
    if (found == kColumns.end()) {
      return AtLine(line, absl::StrCat("column ", n + 1, " is not one of ", KnownColumns(),
                                       "; separate columns with commas"));
    }
    if (std::ranges::find(columns, found) != columns.end()) {
      return AtLine(line, absl::StrCat("column \"", found->name, "\" is there twice"));
    }
    columns.push_back(found);
  }
  std::vector<std::string> missing;
  for (const Column& column : kColumns) {
    const bool is_there = std::ranges::find(columns, &column) != columns.end();
    if (column.required && !is_there) missing.emplace_back(column.name);
  }
  if (missing.empty()) return columns;
  return AtLine(line, absl::StrCat("missing columns: ", absl::StrJoin(missing, ", ")));
}

absl::StatusOr<CohortCase> ReadRow(const std::vector<std::string>& cells, size_t line,
                                   const std::vector<const Column*>& columns,
                                   const fs::path& folder) {
  if (cells.size() != columns.size()) {
    return AtLine(line, absl::StrCat("expected ", columns.size(), " cells, found ", cells.size()));
  }
  CohortCase row;
  for (size_t c = 0; c < cells.size(); ++c) {
    if (cells[c].empty() && columns[c]->required) {
      return AtLine(line, absl::StrCat("\"", columns[c]->name, "\" is empty"));
    }
    const bool is_path = columns[c]->is_path && !cells[c].empty();
    row.*columns[c]->field = is_path ? (folder / cells[c]).lexically_normal().string() : cells[c];
  }
  for (const auto& [name, word] : {std::pair("case", &row.id), {"operation", &row.operation}}) {
    if (IsOperationName(*word)) continue;
    return AtLine(line,
                  absl::StrCat("\"", name, "\" must be 1 to ", kLongestOperationName,
                               " letters, digits, - and _; no path and no name of a patient"));
  }
  return row;
}

// A row with the number of its line.
using NumberedCase = std::pair<size_t, CohortCase>;

absl::StatusOr<std::vector<NumberedCase>> ReadRows(std::istream& file, const fs::path& folder) {
  std::vector<const Column*> columns;
  std::vector<NumberedCase> rows;
  std::map<std::string, size_t> lines;  // by id
  size_t number = 0;
  for (std::string text; std::getline(file, text);) {
    ++number;
    absl::string_view line = text;
    if (number == 1) absl::ConsumePrefix(&line, "\xEF\xBB\xBF");
    if (line.size() > kMaxLineBytes) return AtLine(number, "too long");
    if (absl::StripAsciiWhitespace(line).empty()) continue;
    const std::optional<std::vector<std::string>> cells = CellsOf(line);
    if (!cells) return AtLine(number, "a quotation mark is not closed");
    if (columns.empty()) {
      TF_ASSIGN_OR_RETURN(columns, ReadHeader(*cells, number));
      continue;
    }
    if (rows.size() == kMaxCohortCases) {
      return absl::ResourceExhaustedError(
          absl::StrCat("cohort list: more than ", kMaxCohortCases, " cases; split it"));
    }
    TF_ASSIGN_OR_RETURN(CohortCase row, ReadRow(*cells, number, columns, folder));
    const auto [first, is_new] = lines.emplace(row.id, number);
    if (!is_new) return AtLine(number, absl::StrCat("same case as in line ", first->second));
    rows.emplace_back(number, std::move(row));
  }
  if (rows.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("cohort list: no cases; the first line names the columns (", KnownColumns(),
                     "), each other line is a patient"));
  }
  return rows;
}

// All of them at once: a list is corrected once.
absl::Status CheckFiles(const std::vector<NumberedCase>& rows) {
  std::vector<std::string> missing;
  for (const auto& [line, row] : rows) {
    for (const Column& column : kColumns) {
      const std::string& path = row.*column.field;
      std::error_code error;
      if (!column.is_path || path.empty() || fs::exists(path, error)) continue;
      missing.push_back(absl::StrCat("line ", line, " (", column.name, ")"));
    }
  }
  if (missing.empty()) return absl::OkStatus();
  return absl::NotFoundError(
      absl::StrCat("cohort list: files that do not exist: ", absl::StrJoin(missing, ", ")));
}

}  // namespace

absl::StatusOr<std::vector<CohortCase>> ReadCohortList(const std::string& path) {
  std::error_code error;
  std::ifstream file(path);
  if (!fs::is_regular_file(path, error) || !file) {
    return absl::NotFoundError(
        absl::StrCat("cannot read cohort list ", path, ": no such file, or not a readable one"));
  }
  TF_ASSIGN_OR_RETURN(std::vector<NumberedCase> rows,
                      ReadRows(file, fs::absolute(path, error).parent_path()));
  TF_RETURN_IF_ERROR(CheckFiles(rows));
  std::vector<CohortCase> cases;
  cases.reserve(rows.size());
  for (NumberedCase& row : rows) cases.push_back(std::move(row.second));
  return cases;
}

}  // namespace tissueform
