// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/io/row_counts.h"

#include <array>
#include <filesystem>
#include <fstream>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"

namespace tissueform {
namespace {

struct Section {
  absl::string_view name;
  int numbers_a_line;
};

// Those that Gmsh reads, and cells that it would pass over; a line ends with the reference.
constexpr std::array<Section, 11> kSections = {{{"Vertices", 4},
                                                {"Edges", 3},
                                                {"EdgesP2", 4},
                                                {"Triangles", 4},
                                                {"TrianglesP2", 7},
                                                {"Quadrilaterals", 5},
                                                {"Tetrahedra", 5},
                                                {"TetrahedraP2", 11},
                                                {"Hexahedra", 9},
                                                {"Prisms", 7},
                                                {"Pyramids", 6}}};

const Section* FindSection(absl::string_view word) {
  for (const Section& section : kSections) {
    if (section.name == word) return &section;
  }
  return nullptr;
}

// How many numbers the line holds, or -1 when a word in it is not a number.
int CountNumbers(absl::string_view line) {
  int count = 0;
  for (const absl::string_view word :
       absl::StrSplit(line, absl::ByAnyChar(" \t"), absl::SkipEmpty())) {
    double number = 0;
    if (!absl::SimpleAtod(word, &number)) return -1;
    ++count;
  }
  return count;
}

class MeditLines {
 public:
  explicit MeditLines(const std::string& path) : stream_(path) {}

  bool Next() {
    ++number_;
    if (!std::getline(stream_, line_)) return false;
    absl::StripAsciiWhitespace(&line_);
    return true;
  }

  absl::string_view line() const { return line_; }

  absl::Status Error(absl::string_view what) const {
    return absl::InvalidArgumentError(
        absl::StrCat("line ", number_, ": ", what, "; it is damaged or not laid out line by line"));
  }

  absl::Status CheckSection(const Section& section) {
    int64_t count = 0;
    if (!Next() || !absl::SimpleAtoi(line_, &count) || count < 0) {
      return Error(absl::StrCat("the number of ", section.name, " is missing"));
    }
    // Gmsh would pass over them without a word, and the tets would be taken for the whole body.
    if (count > 0 && (section.name == "Prisms" || section.name == "Pyramids")) {
      return absl::InvalidArgumentError(absl::StrCat("it holds ", count, " ", section.name,
                                                     "; only linear tetrahedra are taken"));
    }
    for (int64_t row = 0; row < count; ++row) {
      if (!Next() || CountNumbers(line_) != section.numbers_a_line) {
        return Error(absl::StrCat("row ", row, " of ", count, " ", section.name, " needs ",
                                  section.numbers_a_line, " numbers"));
      }
    }
    return absl::OkStatus();
  }

 private:
  std::ifstream stream_;
  std::string line_;
  int64_t number_ = 0;
};

}  // namespace

absl::Status CheckMeditLines(const std::string& path) {
  MeditLines lines(path);
  const Section* previous = nullptr;
  while (lines.Next()) {
    if (const Section* section = FindSection(lines.line()); section != nullptr) {
      previous = section;
      if (const absl::Status status = lines.CheckSection(*section); !status.ok()) return status;
    } else if (previous != nullptr && !lines.line().empty() && lines.line()[0] != '#') {
      // Numbers right behind a section are rows beyond its count. Of the rows after any other word
      // nothing is known.
      if (CountNumbers(lines.line()) >= 0) {
        return lines.Error(absl::StrCat("more rows follow than ", previous->name, " announces"));
      }
      previous = nullptr;
    }
  }
  return absl::OkStatus();
}

absl::Status CheckTetgenRows(const std::string& path) {
  std::ifstream stream(path);
  int64_t announced = -1;
  int64_t rows = 0;
  for (std::string line; std::getline(stream, line);) {
    const absl::string_view text = absl::StripAsciiWhitespace(line);
    if (text.empty() || absl::StartsWith(text, "#")) continue;
    if (announced >= 0) {
      ++rows;
    } else if (!absl::SimpleAtoi(text.substr(0, text.find_first_of(" \t,")), &announced) ||
               announced < 0) {
      return absl::InvalidArgumentError("its first line does not begin with a count");
    }
  }
  if (rows == announced) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "the first line of ", std::filesystem::path(path).extension().string(), " announces ",
      announced, " rows, ", rows, " follow; it is truncated or damaged"));
}

}  // namespace tissueform
