// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/label_facts.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace tissueform {
namespace {

// Without a limit a header of a megabyte could make as many entries.
constexpr size_t kMaxFacts = 10000;

std::string TextOr(const std::map<std::string, std::string>& texts, const std::string& key) {
  const auto found = texts.find(key);
  return found == texts.end() ? "" : found->second;
}

// "TerminologyEntry:list~SCT^85756007^Tissue~SCT^91609006^Mandible~^^~...": category, type,
// modifier of the type, and the same of the anatomic region.
void TakeTerminology(absl::string_view tags, SegmentFacts* facts) {
  constexpr absl::string_view kKey = "TerminologyEntry:";
  const size_t begin = tags.find(kKey);
  if (begin == absl::string_view::npos) return;
  const absl::string_view entry = tags.substr(begin + kKey.size());
  const std::vector<absl::string_view> parts =
      absl::StrSplit(entry.substr(0, entry.find('|')), '~');
  for (const size_t part : {size_t{2}, size_t{5}}) {  // the type, then the region
    if (part >= parts.size()) continue;
    const std::vector<std::string> code = absl::StrSplit(parts[part], '^');
    if (code.size() == 3 && !code[1].empty()) facts->codes.push_back({code[0], code[1], code[2]});
  }
}

// The number after `key="`, or nothing.
std::optional<int> AttributeOf(absl::string_view tag, absl::string_view key) {
  const std::string quoted = absl::StrCat(key, "=\"");
  const size_t begin = tag.find(quoted);
  if (begin == absl::string_view::npos) return std::nullopt;
  const absl::string_view rest = tag.substr(begin + quoted.size());
  int number = 0;
  if (!absl::SimpleAtoi(rest.substr(0, rest.find('"')), &number)) return std::nullopt;
  return number;
}

}  // namespace

FactsByLabel FactsOfNrrd(const std::map<std::string, std::string>& texts) {
  FactsByLabel facts;
  for (const auto& [key, name] : texts) {
    constexpr absl::string_view kEnd = "_Name";
    if (!absl::StartsWith(key, "Segment") || !absl::EndsWith(key, kEnd)) continue;
    const std::string segment = key.substr(0, key.size() - kEnd.size());
    int value = 0;
    int layer = 0;
    if (!absl::SimpleAtoi(TextOr(texts, segment + "_LabelValue"), &value)) continue;
    if (!absl::SimpleAtoi(TextOr(texts, segment + "_Layer"), &layer)) layer = 0;
    SegmentFacts& entry = facts[{layer, value}];
    entry.name = name;
    TakeTerminology(TextOr(texts, segment + "_Tags"), &entry);
    if (facts.size() == kMaxFacts) break;
  }
  return facts;
}

FactsByLabel FactsOfNifti(absl::string_view start) {
  constexpr absl::string_view kTag = "<Label ";
  constexpr absl::string_view kText = "<![CDATA[";
  FactsByLabel facts;
  for (size_t at = start.find(kTag); at != absl::string_view::npos; at = start.find(kTag, at + 1)) {
    const absl::string_view rest = start.substr(at);
    const absl::string_view label = rest.substr(0, rest.find("</Label>"));
    const absl::string_view tag = label.substr(0, label.find('>'));
    absl::string_view text = label.substr(std::min(tag.size() + 1, label.size()));
    if (absl::StartsWith(text, kText)) {
      text = text.substr(kText.size());
      text = text.substr(0, text.find("]]>"));
    }
    if (const std::optional<int> value = AttributeOf(tag, "Key")) {
      facts[{0, *value}].name = std::string(text);
    }
    if (facts.size() == kMaxFacts) break;
  }
  return facts;
}

}  // namespace tissueform
