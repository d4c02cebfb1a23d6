// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

namespace tissueform {

// The text with what means something to HTML written as entities; fits into attributes in double
// quotes, too.
std::string EscapeHtml(absl::string_view text);

// A key of report.json as words: "left_out_mm3" becomes "left out [mm³]". Escaped.
std::string LabelOfKey(absl::string_view key);

// A whole page in the style of all reports, with the notice that this is not a medical device above
// and below. `title` is escaped, `content` is HTML.
std::string HtmlPage(absl::string_view title, absl::string_view content);

// A part of a page under a heading, and one that is closed until the reader opens it. `title` is
// escaped, `content` is HTML.
std::string HtmlSection(absl::string_view title, absl::string_view content);
std::string HtmlFolded(absl::string_view title, absl::string_view content);

// A table of an object, one row a key; objects within have rows of their own, a list of objects has
// a row for each, a list of numbers is written in one cell. Numbers are rounded to four digits
// where they are no whole ones. Escaped.
std::string JsonTable(const nlohmann::ordered_json& object);

// One row an element of a list of objects, one column a key of the first that has most. Numbers and
// words stay whole: on a narrow screen the section scrolls sideways.
std::string JsonColumns(const nlohmann::ordered_json& list);

}  // namespace tissueform
