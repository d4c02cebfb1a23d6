// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/html_text.h"

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kLongestList = 12;

// "12,345": so that vertices and tets can be read.
std::string Grouped(int64_t number) {
  std::string digits = absl::StrCat(number);
  const size_t first = number < 0 ? 1 : 0;
  for (size_t place = digits.size(); place > first + 3;) {
    place -= 3;
    digits.insert(place, ",");
  }
  return digits;
}

std::string NumberText(double number) {
  if (std::abs(number) >= 1000 && std::abs(number) < 1e15) return Grouped(std::llround(number));
  return absl::StrFormat("%.4g", number + 0.0);  // no "-0"
}

bool IsList(const Json& value) {
  return value.is_array() && (value.empty() || !value.front().is_structured());
}

std::string ListText(const Json& list);

std::string CellText(const Json& value) {
  if (value.is_string()) return EscapeHtml(value.get_ref<const std::string&>());
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (value.is_number_integer()) return Grouped(value.get<int64_t>());
  if (value.is_number()) return NumberText(value.get<double>());
  if (value.is_array()) return ListText(value);
  if (value.is_null()) return "";
  return EscapeHtml(value.dump());
}

std::string ListText(const Json& list) {
  if (list.empty()) return "none";
  if (list.size() > kLongestList) {
    return absl::StrCat(list.size(), " numbers, see report.json");
  }
  std::string text;
  for (const Json& value : list) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", CellText(value));
  }
  return text;
}

void AppendRows(const std::string& prefix, const Json& value, std::string* rows) {
  if (value.is_object() && !value.empty()) {
    for (const auto& [key, inner] : value.items()) {
      AppendRows(absl::StrCat(prefix, prefix.empty() ? "" : ": ", LabelOfKey(key)), inner, rows);
    }
  } else if (value.is_array() && !IsList(value)) {
    int number = 0;
    for (const Json& inner : value) AppendRows(absl::StrCat(prefix, " ", ++number), inner, rows);
  } else {
    const std::string text = value.is_object() ? "nothing given" : CellText(value);
    absl::StrAppend(rows, "<tr><th scope=\"row\">", prefix, "</th><td>", text, "</td></tr>\n");
  }
}

}  // namespace

std::string EscapeHtml(absl::string_view text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

std::string LabelOfKey(absl::string_view key) {
  static constexpr std::array<std::pair<const char*, const char*>, 7> kUnits = {
      {{"_mm3", "mm³"},
       {"_mm", "mm"},
       {"_deg", "°"},
       {"_pa", "Pa"},
       {"_voxels", "voxels"},
       {"_hu", "HU"},
       {"_sha256", "SHA-256"}}};
  std::string unit;
  for (const auto& [ending, name] : kUnits) {
    if (!absl::EndsWith(key, ending)) continue;
    key.remove_suffix(absl::string_view(ending).size());
    unit = absl::StrCat(" [", name, "]");
    break;
  }
  return EscapeHtml(absl::StrCat(absl::StrReplaceAll(key, {{"_", " "}}), unit));
}

std::string JsonTable(const Json& object) {
  std::string rows;
  AppendRows("", object, &rows);
  return absl::StrCat("<table>\n", rows, "</table>\n");
}

std::string JsonColumns(const Json& list) {
  std::vector<std::string> keys;
  for (const Json& row : list) {
    if (row.size() <= keys.size()) continue;
    keys.clear();
    for (const auto& [key, value] : row.items()) keys.push_back(key);
  }
  std::string html = "<table>\n<tr>";
  for (const std::string& key : keys) {
    absl::StrAppend(&html, "<th scope=\"col\">", LabelOfKey(key), "</th>");
  }
  absl::StrAppend(&html, "</tr>\n");
  for (const Json& row : list) {
    absl::StrAppend(&html, "<tr>");
    for (const std::string& key : keys) {
      absl::StrAppend(&html, "<td>", row.contains(key) ? CellText(row.at(key)) : "", "</td>");
    }
    absl::StrAppend(&html, "</tr>\n");
  }
  return absl::StrCat(html, "</table>\n");
}

}  // namespace tissueform
