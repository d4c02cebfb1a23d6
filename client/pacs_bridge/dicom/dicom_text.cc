// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/dicom_text.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

namespace tissueform {
namespace {

// Beyond this a value is not even taken from the file.
constexpr Uint32 kMaxRawBytes = 1 << 20;
// Converted, of a name of 100,000 characters, before it is cut.
constexpr size_t kConvertedBytes = 8192;
constexpr size_t kMaxCharacterBytes = 4;  // of any set, and of an escape sequence

bool IsAscii(absl::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x80 && c != '\x1B'; });
}

std::string OnlyAscii(absl::string_view text) {
  std::string kept(text);
  for (char& c : kept) {
    if (static_cast<unsigned char>(c) >= 0x80 || c == '\x1B') c = '?';
  }
  return kept;
}

// At the last whole character.
void CutUtf8(size_t bytes, std::string* text) {
  while (bytes > 0 && (static_cast<unsigned char>((*text)[bytes]) & 0xC0) == 0x80) --bytes;
  text->resize(bytes);
}

// Control characters would end lines of a log or a list.
std::string Tidy(std::string text) {
  for (char& c : text) {
    if (absl::ascii_iscntrl(static_cast<unsigned char>(c))) c = ' ';
  }
  return std::string(absl::StripAsciiWhitespace(text));
}

// Of any text: what is longer than 64 KiB is written without its kind, as bytes.
std::string RawText(DcmElement* element) {
  Uint8* bytes = nullptr;
  if (element->ident() == EVR_UN) {
    if (element->getUint8Array(bytes).bad() || bytes == nullptr) return {};
    return {reinterpret_cast<const char*>(bytes), element->getLength()};
  }
  OFString value;
  if (element->getOFStringArray(value, OFTrue).bad()) return {};
  return {value.c_str(), value.size()};
}

// Of the character sets.
std::string NamesOf(DcmItem* dataset) {
  OFString names;
  if (dataset->findAndGetOFStringArray(DCM_SpecificCharacterSet, names).bad()) return {};
  return {names.c_str(), names.size()};
}

}  // namespace

DicomTexts::DicomTexts(DcmItem* dataset) : dataset_(dataset), set_(NamesOf(dataset)) {}

void DicomTexts::ReportProblem(absl::string_view what) {
  if (problem_.empty()) problem_ = std::string(what);
}

std::string DicomTexts::ToUtf8(const DcmTagKey& tag, const std::string& raw, bool is_name) {
  if (IsAscii(raw)) return raw;
  if (std::optional<std::string> text = set_.ToUtf8(raw, is_name)) return *std::move(text);
  ReportProblem(absl::StrCat("the attribute ", tag.toString().c_str(),
                             " is not in the character set that ",
                             "SpecificCharacterSet (0008,0005) names, or that set is unknown"));
  return OnlyAscii(raw);
}

// A character or escape sequence that would end beyond the cut is left out whole.
void DicomTexts::CutRaw(bool is_name, std::string* raw) const {
  raw->resize(kConvertedBytes);
  for (size_t cut = 0; cut < kMaxCharacterBytes; ++cut) {
    const absl::string_view shorter = absl::string_view(*raw).substr(0, raw->size() - cut);
    if (!set_.ToUtf8(shorter, is_name).has_value()) continue;
    return raw->resize(shorter.size());
  }
}

std::string DicomTexts::Get(const DcmTagKey& tag) {
  DcmElement* element = nullptr;
  if (dataset_->findAndGetElement(tag, element).bad() || element == nullptr) return {};
  if (element->getLength() > kMaxRawBytes) {
    ReportProblem(absl::StrCat("the attribute ", tag.toString().c_str(), " has more than ",
                               kMaxRawBytes, " bytes and is not read"));
    return {};
  }
  std::string raw = RawText(element);
  const bool is_name = DcmTag(tag).getEVR() == EVR_PN;
  const bool long_before = raw.size() > kConvertedBytes;
  if (long_before) CutRaw(is_name, &raw);
  std::string text = Tidy(ToUtf8(tag, raw, is_name));
  if (text.size() > kMaxBytes) CutUtf8(kMaxBytes, &text);
  if (long_before || text.size() + 3 >= kMaxBytes) {
    ReportProblem(absl::StrCat("the attribute ", tag.toString().c_str(), " is longer than ",
                               kMaxBytes, " bytes and is cut"));
  }
  return text;
}

}  // namespace tissueform
