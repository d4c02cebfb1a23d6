// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace tissueform {

// A table of text that becomes a file.
class CsvTable {
 public:
  explicit CsvTable(std::vector<std::string> header);

  // REQUIRES: as many cells as the header has.
  void AddRow(std::vector<std::string> cells);

  // RFC 4180 with line feeds: cells with a comma or a quotation mark are quoted.
  std::string Csv() const;
  // A table of GitHub's Markdown.
  std::string Markdown() const;

  // As Csv, with a last column "notice" that says in every row that this comes from no medical
  // device: a first line that is no row would stop most readers.
  absl::Status WriteCsv(const std::string& path) const;

 private:
  std::vector<std::vector<std::string>> rows_;  // the header first
};

// What the column says.
inline constexpr char kCsvNotice[] = "research software - not a medical device";

// A number as a cell, with up to six digits that count.
std::string Cell(double value);

}  // namespace tissueform
