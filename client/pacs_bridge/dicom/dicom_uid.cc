// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/dicom_uid.h"

#include <algorithm>
#include <cstdint>
#include <random>
#include <sstream>
#include <vector>

#include "absl/numeric/int128.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_split.h"

namespace tissueform {
namespace {

constexpr size_t kMaxUidCharacters = 64;

uint64_t RandomWord() {
  thread_local std::random_device device;
  return (uint64_t{device()} << 32) | device();
}

bool IsComponent(absl::string_view text) {
  return !text.empty() && (text.size() == 1 || text[0] != '0') &&
         std::all_of(text.begin(), text.end(), absl::ascii_isdigit);
}

}  // namespace

std::string NewDicomUid() {
  const uint64_t high = (RandomWord() & ~uint64_t{0xF000}) | 0x4000;                // version 4
  const uint64_t low = (RandomWord() & (~uint64_t{0} >> 2)) | (uint64_t{1} << 63);  // variant 1
  std::ostringstream text;
  text << "2.25." << absl::MakeUint128(high, low);
  return text.str();
}

bool IsDicomUid(absl::string_view text) {
  if (text.empty() || text.size() > kMaxUidCharacters) return false;
  const std::vector<absl::string_view> components = absl::StrSplit(text, '.');
  return std::all_of(components.begin(), components.end(), IsComponent);
}

}  // namespace tissueform
