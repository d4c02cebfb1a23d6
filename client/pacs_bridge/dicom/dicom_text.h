// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/string_view.h"

#include "client/pacs_bridge/dicom/character_set.h"

class DcmItem;
class DcmTagKey;

namespace tissueform {

// The texts of one data set as UTF-8. Every character set of the standard is decoded.
//
// The data set outlives it. One thread.
class DicomTexts {
 public:
  // No value is longer; by the standard a name has 64 characters a group.
  static constexpr size_t kMaxBytes = 1024;

  explicit DicomTexts(DcmItem* dataset);
  DicomTexts(const DicomTexts&) = delete;
  DicomTexts& operator=(const DicomTexts&) = delete;

  // The whole value (all of several, with "\\" between), without padding and control characters;
  // empty if the tag is missing. Text that cannot be converted has "?" for every byte that is not
  // ASCII; a text over kMaxBytes is cut at a character. `problem` reports both.
  std::string Get(const DcmTagKey& tag);

  // What was wrong first, in one line without a value; empty: nothing.
  const std::string& problem() const { return problem_; }

 private:
  void CutRaw(bool is_name, std::string* raw) const;
  std::string ToUtf8(const DcmTagKey& tag, const std::string& raw, bool is_name);
  void ReportProblem(absl::string_view what);

  DcmItem* const dataset_;
  const CharacterSet set_;
  std::string problem_;
};

}  // namespace tissueform
