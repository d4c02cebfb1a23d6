// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/character_set.h"

#include <algorithm>
#include <array>
#include <iconv.h>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"

namespace tissueform {
namespace {

constexpr char kEscape = '\x1B';
constexpr unsigned char kHighBit = 0x80;
// No set's character has more bytes in UTF-8 than this for each of its own.
constexpr size_t kMaxGrowth = 4;

constexpr int kAsciiSet = 6;
constexpr int kJisX0201 = 13;
constexpr std::array<int, 3> kJapaneseSets = {kJisX0201, 87, 159};

// A code element: what an escape sequence makes of the lower (G0) or the upper (G1) bytes.
struct CodeElement {
  int set;
  absl::string_view escape;
  bool upper;
  // An encoding of iconv that has the element's characters under their bytes with the high bit set,
  // after `prefix`; empty: the bytes are ASCII.
  const char* encoding;
  absl::string_view prefix;
  size_t width;         // bytes of a character
  unsigned char first;  // without the high bit
  unsigned char last;
};

// Tables C.12-3 and C.12-4. One element of a set at most is an upper one.
constexpr std::array<CodeElement, 18> kElements = {{
    {kAsciiSet, "(B", false, "", "", 1, 0x21, 0x7E},
    {100, "-A", true, "ISO-8859-1", "", 1, 0x20, 0x7F},
    {101, "-B", true, "ISO-8859-2", "", 1, 0x20, 0x7F},
    {109, "-C", true, "ISO-8859-3", "", 1, 0x20, 0x7F},
    {110, "-D", true, "ISO-8859-4", "", 1, 0x20, 0x7F},
    {144, "-L", true, "ISO-8859-5", "", 1, 0x20, 0x7F},
    {127, "-G", true, "ISO-8859-6", "", 1, 0x20, 0x7F},
    {126, "-F", true, "ISO-8859-7", "", 1, 0x20, 0x7F},
    {138, "-H", true, "ISO-8859-8", "", 1, 0x20, 0x7F},
    {148, "-M", true, "ISO-8859-9", "", 1, 0x20, 0x7F},
    {203, "-b", true, "ISO-8859-15", "", 1, 0x20, 0x7F},
    {166, "-T", true, "ISO-8859-11", "", 1, 0x20, 0x7F},
    {kJisX0201, "(J", false, "", "", 1, 0x21, 0x7E},
    {kJisX0201, ")I", true, "EUC-JP", "\x8E", 1, 0x21, 0x5F},
    {87, "$B", false, "EUC-JP", "", 2, 0x21, 0x7E},
    {159, "$(D", false, "EUC-JP", "\x8F", 2, 0x21, 0x7E},
    {149, "$)C", true, "EUC-KR", "", 2, 0x21, 0x7E},
    {58, "$)A", true, "EUC-CN", "", 2, 0x21, 0x7E},
}};
constexpr const CodeElement& kAscii = kElements.front();

bool IsControl(char c) { return static_cast<unsigned char>(c) < 0x20 || c == '\x7F'; }
bool IsUpper(char c) { return (static_cast<unsigned char>(c) & kHighBit) != 0; }
bool EndsLine(char c) { return c == '\r' || c == '\n' || c == '\f' || c == '\t'; }

// The encoding of a set that is not part of ISO 2022; empty for those that are.
std::string WholeEncoding(absl::string_view name) {
  if (name == "ISO_IR 192") return "UTF-8";
  if (name == "GB18030" || name == "GBK") return std::string(name);
  return "";
}

// "ISO_IR 100" and "ISO 2022 IR 100" alike, also as they are misspelled; -1: not known.
int SetOf(absl::string_view name) {
  if (name.empty()) return kAsciiSet;
  const std::string plain =
      absl::StrReplaceAll(absl::StrReplaceAll(name, {{"_", " "}, {"-", " "}}), {{"2022 ", ""}});
  absl::string_view digits = plain;
  int set = 0;
  if (!absl::ConsumePrefix(&digits, "ISO IR ") || !absl::SimpleAtoi(digits, &set)) return -1;
  return set;
}

const CodeElement* UpperOf(int set) {
  const auto* const found = std::find_if(
      kElements.begin(), kElements.end(),
      [set](const CodeElement& element) { return element.set == set && element.upper; });
  return found == kElements.end() ? nullptr : found;
}

std::optional<std::string> Convert(const std::string& encoding, absl::string_view raw) {
  const iconv_t converter = iconv_open("UTF-8", encoding.c_str());
  if (converter == reinterpret_cast<iconv_t>(-1)) return {};
  std::string text(kMaxGrowth * raw.size(), '\0');
  std::string bytes(raw);
  char* from = bytes.data();
  size_t from_left = bytes.size();
  char* to = text.data();
  size_t to_left = text.size();
  const bool good = iconv(converter, &from, &from_left, &to, &to_left) != static_cast<size_t>(-1);
  iconv_close(converter);
  if (!good) return {};
  text.resize(text.size() - to_left);
  return text;
}

// One text by ISO 2022. Characters of one encoding are gathered, and converted where it changes.
class Iso2022Decoder {
 public:
  Iso2022Decoder(const std::vector<int>& sets, bool is_name)
      : sets_(sets), is_name_(is_name), upper_at_start_(UpperOf(sets.front())) {
    Reset();
  }

  std::optional<std::string> Decode(absl::string_view raw) {
    while (!raw.empty()) {
      if (!(raw.front() == kEscape ? TakeEscape(&raw) : TakeCharacter(&raw))) return {};
    }
    if (!Flush()) return {};
    return text_;
  }

 private:
  void Reset() {
    lower_ = &kAscii;
    upper_ = upper_at_start_;
  }

  bool IsNamed(int set) const {
    return set == kAsciiSet || std::find(sets_.begin(), sets_.end(), set) != sets_.end();
  }

  // Japanese texts go back to ISO-IR 14 instead of ASCII, whether it is named or not.
  bool MayUse(const CodeElement& element) const {
    if (element.set == kJisX0201 && !element.upper) {
      return std::any_of(kJapaneseSets.begin(), kJapaneseSets.end(),
                         [this](int set) { return IsNamed(set); });
    }
    return IsNamed(element.set);
  }

  bool TakeEscape(absl::string_view* raw) {
    raw->remove_prefix(1);
    for (const CodeElement& element : kElements) {
      if (!MayUse(element) || !absl::ConsumePrefix(raw, element.escape)) continue;
      (element.upper ? upper_ : lower_) = &element;
      return true;
    }
    return false;
  }

  bool TakeCharacter(absl::string_view* raw) {
    const char c = raw->front();
    if (EndsLine(c)) Reset();
    const CodeElement* const element = IsUpper(c) ? upper_ : lower_;
    if (element == nullptr) return false;
    if (c == ' ' || IsControl(c)) return Add(kAscii, raw, 1);
    // Within a character of two bytes, "^" is one of them.
    if (element->width == 1 && (c == '\\' || (is_name_ && (c == '^' || c == '=')))) Reset();
    if (raw->size() < element->width) return false;
    for (const char byte : raw->substr(0, element->width)) {
      const auto plain = static_cast<unsigned char>(byte & ~kHighBit);
      if (IsUpper(byte) != element->upper || plain < element->first || plain > element->last) {
        return false;
      }
    }
    return Add(*element, raw, element->width);
  }

  bool Add(const CodeElement& element, absl::string_view* raw, size_t bytes) {
    if (pending_encoding_ != element.encoding) {
      if (!Flush()) return false;
      pending_encoding_ = element.encoding;
    }
    absl::StrAppend(&pending_, element.prefix);
    for (const char byte : raw->substr(0, bytes)) {
      pending_.push_back(static_cast<char>(pending_encoding_.empty() ? byte : byte | kHighBit));
    }
    raw->remove_prefix(bytes);
    return true;
  }

  bool Flush() {
    const std::optional<std::string> converted =
        pending_encoding_.empty() ? pending_ : Convert(pending_encoding_, pending_);
    if (!converted.has_value()) return false;
    text_ += *converted;
    pending_.clear();
    return true;
  }

  const std::vector<int>& sets_;
  const bool is_name_;
  const CodeElement* const upper_at_start_;
  const CodeElement* lower_ = nullptr;
  const CodeElement* upper_ = nullptr;  // null: no set is there
  std::string pending_encoding_;
  std::string pending_;
  std::string text_;
};

}  // namespace

CharacterSet::CharacterSet(absl::string_view names) {
  for (absl::string_view name : absl::StrSplit(names, '\\')) {
    name = absl::StripAsciiWhitespace(name);
    if (sets_.empty()) whole_ = WholeEncoding(name);
    sets_.push_back(SetOf(name));
  }
}

std::optional<std::string> CharacterSet::ToUtf8(absl::string_view raw, bool is_name) const {
  if (!whole_.empty()) return Convert(whole_, raw);
  return Iso2022Decoder(sets_, is_name).Decode(raw);
}

}  // namespace tissueform
