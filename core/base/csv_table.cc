// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/csv_table.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

#include "core/base/atomic_file.h"

namespace tissueform {
namespace {

std::string Quoted(const std::string& cell) {
  if (cell.find_first_of(",\"\n") == std::string::npos) return cell;
  return absl::StrCat("\"", absl::StrReplaceAll(cell, {{"\"", "\"\""}}), "\"");
}

std::string Line(const std::vector<std::string>& row) {
  return absl::StrJoin(
      row, ",", [](std::string* out, const std::string& cell) { out->append(Quoted(cell)); });
}

}  // namespace

CsvTable::CsvTable(std::vector<std::string> header) { rows_.push_back(std::move(header)); }

void CsvTable::AddRow(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }

std::string CsvTable::Csv() const {
  std::string text;
  for (const auto& row : rows_) absl::StrAppend(&text, Line(row), "\n");
  return text;
}

std::string CsvTable::Markdown() const {
  std::string text;
  for (size_t r = 0; r < rows_.size(); ++r) {
    absl::StrAppend(&text, "| ", absl::StrJoin(rows_[r], " | "), " |\n");
    if (r > 0) continue;
    absl::StrAppend(&text, "|");
    for (size_t c = 0; c < rows_[r].size(); ++c) absl::StrAppend(&text, "---|");
    absl::StrAppend(&text, "\n");
  }
  return text;
}

absl::Status CsvTable::WriteCsv(const std::string& path) const {
  std::string text;
  for (size_t r = 0; r < rows_.size(); ++r) {
    absl::StrAppend(&text, Line(rows_[r]), ",", r == 0 ? "notice" : kCsvNotice, "\n");
  }
  return WriteFileAtomically(path, text);
}

std::string Cell(double value) { return absl::StrFormat("%.6g", value); }

}  // namespace tissueform
