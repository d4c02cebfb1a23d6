// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace tissueform {

// Decodes texts by SpecificCharacterSet (0008,0005): every set of PS3.3 C.12.1.1.2, with code
// extensions (PS3.5 6.1.2.5) and without. DCMTK's own conversion is not used: with the GNU C
// library it knows neither the Japanese sets of ISO 2022 nor Latin 9.
//
// Any thread.
class CharacterSet {
 public:
  // `names` as in the attribute, "\\" between them. A name that is not known matters to the texts
  // that need it.
  explicit CharacterSet(absl::string_view names);

  // The text as UTF-8; nothing where a byte or an escape sequence is not of a set that is named.
  // Of ISO-IR 14 the yen sign and the overline are read as "\\" and "~", as other readers do.
  // `is_name`: "^" and "=" bring the first set back, as "\\" and the end of a line always do.
  std::optional<std::string> ToUtf8(absl::string_view raw, bool is_name) const;

 private:
  std::string whole_;      // encoding of a set that allows no others; empty: ISO 2022
  std::vector<int> sets_;  // numbers of ISO-IR; the first one counts from the start of a text
};

}  // namespace tissueform
