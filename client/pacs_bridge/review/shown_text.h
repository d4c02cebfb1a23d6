// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace tissueform {

// "&<>\"'" as entities; control characters, and what is no UTF-8, as U+FFFD.
std::string EscapedHtml(absl::string_view text);
// "Planted, Patricia Q" of "Planted^Patricia^Q"; of several groups the first with the others in
// brackets.
std::string ShownName(const std::string& dicom_name);
// "1961-02-03" of "19610203"; anything else stays.
std::string ShownDate(const std::string& dicom_date);

}  // namespace tissueform
