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

constexpr char kHead[] = R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>@TITLE@</title>
<style>
:root { --ink: #1c2733; --soft: #5b6875; --line: #dde3e9; --paper: #fff; --good: #1b7f4b; --bad: #b3261e; }
body { margin: 0; background: #eef1f4; color: var(--ink); font: 16px/1.5 system-ui, "Segoe UI", Roboto, sans-serif; }
main { max-width: 68rem; margin: 0 auto; padding: 0 1rem 3rem; }
.notice { background: #263442; color: #fff; text-align: center; padding: .5rem 1rem; margin: 0; }
h1 { font-size: 1.9rem; margin: 1.6rem 0 .3rem; }
h2 { font-size: 1.25rem; margin: 0 0 .8rem; }
section, figure { background: var(--paper); border: 1px solid var(--line); border-radius: .6rem; padding: 1.1rem 1.3rem; margin: 1rem 0; overflow-x: auto; }
.lead { color: var(--soft); margin: 0 0 1rem; }
.facts { display: flex; flex-wrap: wrap; gap: .8rem; }
.facts div { flex: 1 1 9rem; background: var(--paper); border: 1px solid var(--line); border-radius: .6rem; padding: .7rem 1rem; }
.facts b { display: block; font-size: 1.45rem; font-variant-numeric: tabular-nums; }
.facts span { color: var(--soft); font-size: .9rem; }
table { border-collapse: collapse; width: 100%; font-size: .93rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .32rem .8rem .32rem 0; border-bottom: 1px solid var(--line); overflow-wrap: anywhere; }
table:has(th[scope=col]) :is(th, td) { overflow-wrap: normal; }
th { font-weight: 500; color: var(--soft); }
th[scope=row] { width: 38%; }
.passed { color: var(--good); font-weight: 600; }
.failed { color: var(--bad); font-weight: 600; }
figure img { width: 100%; height: auto; display: block; }
figcaption { margin-top: .7rem; }
.legend { list-style: none; display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; padding: 0; margin: .5rem 0 0; font-size: .93rem; }
.legend i { display: inline-block; width: .9em; height: .9em; border-radius: .2em; margin-right: .4em; border: 1px solid rgba(0,0,0,.25); vertical-align: -.08em; }
details > summary { cursor: pointer; font-size: 1.25rem; font-weight: 700; }
@media print { body { background: #fff; } section, figure { break-inside: avoid; border: 0; padding: 0; } }
</style>
</head>
<body>
<p class="notice">Research software, not a medical device. Not for diagnosis or treatment.</p>
<main>
)";

constexpr char kFoot[] = R"(</main>
<p class="notice">Research software, not a medical device. Not for diagnosis or treatment.</p>
</body>
</html>
)";

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

std::string HtmlSection(absl::string_view title, absl::string_view content) {
  return absl::StrCat("<section>\n<h2>", EscapeHtml(title), "</h2>\n", content, "</section>\n");
}

std::string HtmlFolded(absl::string_view title, absl::string_view content) {
  return absl::StrCat("<section><details>\n<summary>", EscapeHtml(title), "</summary>\n", content,
                      "</details></section>\n");
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

std::string HtmlPage(absl::string_view title, absl::string_view content) {
  return absl::StrCat(absl::StrReplaceAll(kHead, {{"@TITLE@", EscapeHtml(title)}}), content, kFoot);
}

}  // namespace tissueform
