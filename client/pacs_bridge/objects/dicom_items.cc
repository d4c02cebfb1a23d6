// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/dicom_items.h"

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

namespace tissueform {

CodedTerm OwnTerm(const std::string& value, const std::string& meaning) {
  return {value, kOwnScheme, meaning};
}

CodedTerm UnitTerm(const std::string& ucum) {
  const bool is_mm = ucum == "mm";
  return {ucum, "UCUM", is_mm ? "millimeter" : ucum == "deg" ? "degree" : "no units"};
}

std::string PlainDicomText(absl::string_view text, size_t most) {
  std::string plain(text.substr(0, most));
  for (char& c : plain) {
    if (!absl::ascii_isprint(static_cast<unsigned char>(c)) || c == '\\') c = '?';
  }
  return plain;
}

bool ItemWriter::Good(const DcmTagKey& tag, bool done) {
  if (!done && status_.ok()) {
    status_ = absl::InternalError(
        absl::StrCat("the attribute ", tag.toString().c_str(), " cannot be written"));
  }
  return done;
}

void ItemWriter::Text(const DcmTagKey& tag, const std::string& value) {
  if (item_ != nullptr) Good(tag, item_->putAndInsertString(tag, value.c_str()).good());
}

void ItemWriter::Number(const DcmTagKey& tag, uint16_t value) {
  if (item_ != nullptr) Good(tag, item_->putAndInsertUint16(tag, value).good());
}

void ItemWriter::LongNumber(const DcmTagKey& tag, uint32_t value) {
  if (item_ != nullptr) Good(tag, item_->putAndInsertUint32(tag, value).good());
}

void ItemWriter::Bytes(const DcmTagKey& tag, const std::vector<uint8_t>& value) {
  if (item_ == nullptr) return;
  Good(tag, item_->putAndInsertUint8Array(tag, value.data(), value.size()).good());
}

void ItemWriter::Code(const DcmTagKey& tag, const CodedTerm& term) {
  ItemWriter item = NewItem(tag);
  item.Text(DCM_CodeValue, term.value);
  item.Text(DCM_CodingSchemeDesignator, term.scheme);
  item.Text(DCM_CodeMeaning, term.meaning);
  Take(item);
}

void ItemWriter::EmptySequence(const DcmTagKey& tag) {
  if (item_ != nullptr) Good(tag, item_->insertEmptyElement(tag).good());
}

ItemWriter ItemWriter::NewItem(const DcmTagKey& tag) {
  DcmItem* item = nullptr;
  // -2 asks for a new one at the end.
  if (item_ != nullptr) Good(tag, item_->findOrCreateSequenceItem(tag, item, -2).good());
  return ItemWriter(item);
}

void ItemWriter::Take(const ItemWriter& item) {
  if (status_.ok()) status_ = item.status();
}

}  // namespace tissueform
