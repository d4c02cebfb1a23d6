// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

class DcmItem;
class DcmTagKey;

namespace tissueform {

// A term of a coding scheme (PS3.3 8.8).
struct CodedTerm {
  std::string value = {};  // at most 16 characters
  std::string scheme = {};
  std::string meaning = {};  // at most 64 characters
};

inline constexpr char kOwnScheme[] = "99TISSUEFORM";

// Of ours, where the standard has none (docs/pacs.md).
CodedTerm OwnTerm(const std::string& value, const std::string& meaning);
CodedTerm UnitTerm(const std::string& ucum);

// At most `most` characters of printable ASCII, which every character set of DICOM shares; anything
// else, and the backslash, which separates values, is "?".
std::string PlainDicomText(absl::string_view text, size_t most);

// Puts values into an item, replacing those that are there, until one fails: then status() reports
// the error, with its tag. The item outlives it.
class ItemWriter {
 public:
  explicit ItemWriter(DcmItem* item) : item_(item) {}

  void Text(const DcmTagKey& tag, const std::string& value);  // several with "\\" between
  void Number(const DcmTagKey& tag, uint16_t value);
  void LongNumber(const DcmTagKey& tag, uint32_t value);
  void Bytes(const DcmTagKey& tag, const std::vector<uint8_t>& value);  // of even number
  // A sequence of one item with the term; of none.
  void Code(const DcmTagKey& tag, const CodedTerm& term);
  void EmptySequence(const DcmTagKey& tag);
  // A new item at the end of a sequence; writes nothing when something has failed.
  ItemWriter NewItem(const DcmTagKey& tag);
  // Keeps what an item of NewItem has failed with.
  void Take(const ItemWriter& item);

  const absl::Status& status() const { return status_; }

 private:
  bool Good(const DcmTagKey& tag, bool done);

  DcmItem* item_;  // null: nothing is written
  absl::Status status_;
};

}  // namespace tissueform
