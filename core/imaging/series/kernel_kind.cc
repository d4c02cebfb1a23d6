// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/series/kernel_kind.h"

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/string_view.h"

namespace tissueform {
namespace {

// From which number on Siemens' kernels are sharp (B60s, H60s, Hr59 are; B30f, J40s are not).
constexpr int kSharpNumber = 50;

// The digits after the leading letters: 60 of "Hr60s"; -1: none.
int NumberIn(absl::string_view name) {
  size_t begin = 0;
  while (begin < name.size() && absl::ascii_isalpha(static_cast<unsigned char>(name[begin])))
    ++begin;
  size_t end = begin;
  while (end < name.size() && absl::ascii_isdigit(static_cast<unsigned char>(name[end]))) ++end;
  int number = -1;
  if (begin == 0 || end - begin != 2) return -1;
  return absl::SimpleAtoi(name.substr(begin, end - begin), &number) ? number : -1;
}

}  // namespace

KernelKind KernelKindOf(const std::string& kernel) {
  const std::string upper = absl::AsciiStrToUpper(kernel);
  for (const char* word : {"BONE", "EDGE", "SHARP", "LUNG", "DETAIL"}) {
    if (absl::StrContains(upper, word)) return KernelKind::kBone;
  }
  for (const char* word : {"SOFT", "STANDARD", "STND", "SMOOTH", "BRAIN"}) {
    if (absl::StrContains(upper, word)) return KernelKind::kSoft;
  }
  const int number = NumberIn(upper);
  if (absl::StartsWith(upper, "FC") && number >= 0) {  // Canon, Toshiba
    return (number >= 30 && number < 40) || number >= 50 ? KernelKind::kBone : KernelKind::kSoft;
  }
  if (number < 0) return KernelKind::kUnknown;
  return number >= kSharpNumber ? KernelKind::kBone : KernelKind::kSoft;
}

}  // namespace tissueform
