// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/review/shown_text.h"

#include <algorithm>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace tissueform {
namespace {

constexpr absl::string_view kReplacement = "\xEF\xBF\xBD";

// How many bytes of a UTF-8 character begin `text`; 0: none does.
size_t CharacterBytes(absl::string_view text) {
  const auto byte = [text](size_t i) { return static_cast<unsigned char>(text[i]); };
  const size_t length = byte(0) < 0x80   ? 1
                        : byte(0) < 0xC2 ? 0
                        : byte(0) < 0xE0 ? 2
                        : byte(0) < 0xF0 ? 3
                        : byte(0) < 0xF5 ? 4
                                         : 0;
  if (length == 0 || text.size() < length) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
  }
  // Overlong forms, surrogates, and what lies beyond Unicode.
  if (byte(0) == 0xE0 && byte(1) < 0xA0) return 0;
  if (byte(0) == 0xED && byte(1) > 0x9F) return 0;
  if (byte(0) == 0xF0 && byte(1) < 0x90) return 0;
  if (byte(0) == 0xF4 && byte(1) > 0x8F) return 0;
  return length;
}

}  // namespace

std::string EscapedHtml(absl::string_view text) {
  std::string escaped;
  while (!text.empty()) {
    const size_t bytes = CharacterBytes(text);
    const auto first = static_cast<unsigned char>(text.front());
    if (bytes == 0 || first < 0x20 || first == 0x7F) {
      absl::StrAppend(&escaped, kReplacement);
    } else if (first == '&') {
      absl::StrAppend(&escaped, "&amp;");
    } else if (first == '<') {
      absl::StrAppend(&escaped, "&lt;");
    } else if (first == '>') {
      absl::StrAppend(&escaped, "&gt;");
    } else if (first == '"') {
      absl::StrAppend(&escaped, "&quot;");
    } else if (first == '\'') {
      absl::StrAppend(&escaped, "&#39;");
    } else {
      absl::StrAppend(&escaped, text.substr(0, bytes));
    }
    text.remove_prefix(std::max<size_t>(bytes, 1));
  }
  return escaped;
}

std::string ShownName(const std::string& dicom_name) {
  std::vector<std::string> groups;
  for (const absl::string_view group : absl::StrSplit(dicom_name, '=')) {
    std::vector<absl::string_view> parts = absl::StrSplit(group, '^');
    const std::string family(parts.front());
    parts.erase(parts.begin());
    std::string rest = absl::StrJoin(parts, " ");
    absl::StripAsciiWhitespace(&rest);
    if (family.empty() && rest.empty()) continue;
    groups.push_back(rest.empty() ? family : absl::StrCat(family, ", ", rest));
  }
  if (groups.empty()) return {};
  const std::string first = groups.front();
  groups.erase(groups.begin());
  return groups.empty() ? first : absl::StrCat(first, " (", absl::StrJoin(groups, "; "), ")");
}

std::string ShownDate(const std::string& dicom_date) {
  const bool is_date =
      dicom_date.size() == 8 && std::all_of(dicom_date.begin(), dicom_date.end(), [](char c) {
        return absl::ascii_isdigit(static_cast<unsigned char>(c));
      });
  if (!is_date) return dicom_date;
  return absl::StrCat(dicom_date.substr(0, 4), "-", dicom_date.substr(4, 2), "-",
                      dicom_date.substr(6));
}

}  // namespace tissueform
