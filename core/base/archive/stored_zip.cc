// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/archive/stored_zip.h"

#include <cstdint>
#include <limits>
#include <zlib.h>

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

// Sections 4.3.7, 4.3.12 and 4.3.16 of the format (APPNOTE.TXT 6.3.10).
constexpr uint32_t kMemberMagic = 0x04034b50;
constexpr uint32_t kEntryMagic = 0x02014b50;
constexpr uint32_t kEndMagic = 0x06054b50;
constexpr uint16_t kVersion = 20;
constexpr uint16_t kNamesAreUtf8 = 1 << 11;
constexpr uint16_t kFirstDay = (1 << 5) + 1;  // 1980-01-01: the earliest date that it can hold

void Append16(uint32_t value, std::string* to) {
  to->push_back(static_cast<char>(value & 0xff));
  to->push_back(static_cast<char>(value >> 8 & 0xff));
}

void Append32(uint32_t value, std::string* to) {
  Append16(value & 0xffff, to);
  Append16(value >> 16, to);
}

// What a member's header and its entry in the directory have in common.
std::string CommonFields(const ZipMember& member) {
  const auto size = static_cast<uint32_t>(member.bytes.size());
  const uLong sum = crc32_z(0, reinterpret_cast<const Bytef*>(member.bytes.data()), size);
  std::string fields;
  for (const uint32_t value :
       {uint32_t{kVersion}, uint32_t{kNamesAreUtf8}, 0U, 0U, uint32_t{kFirstDay}}) {
    Append16(value, &fields);
  }
  Append32(static_cast<uint32_t>(sum), &fields);
  Append32(size, &fields);  // stored
  Append32(size, &fields);
  Append16(static_cast<uint32_t>(member.path.size()), &fields);
  Append16(0, &fields);
  return fields;
}

bool IsTooLarge(const std::vector<ZipMember>& members) {
  uint64_t bytes = 0;
  for (const ZipMember& member : members) {
    bytes += member.bytes.size() + 2 * member.path.size() + 128;
    if (member.path.size() > std::numeric_limits<uint16_t>::max()) return true;
  }
  return members.size() > std::numeric_limits<uint16_t>::max() ||
         bytes > std::numeric_limits<uint32_t>::max();
}

}  // namespace

absl::StatusOr<std::string> StoredZip(const std::vector<ZipMember>& members) {
  if (IsTooLarge(members)) {
    return absl::ResourceExhaustedError("the files are too many or too large for one zip");
  }
  std::string zip;
  std::string directory;
  for (const ZipMember& member : members) {
    const std::string fields = CommonFields(member);
    Append32(kEntryMagic, &directory);
    Append16(kVersion, &directory);
    directory += fields;
    for (int i = 0; i < 3; ++i) Append16(0, &directory);  // comment, disk, attributes
    Append32(0, &directory);
    Append32(static_cast<uint32_t>(zip.size()), &directory);
    directory += member.path;
    Append32(kMemberMagic, &zip);
    absl::StrAppend(&zip, fields, member.path, member.bytes);
  }
  const auto directory_at = static_cast<uint32_t>(zip.size());
  zip += directory;
  Append32(kEndMagic, &zip);
  Append32(0, &zip);  // the disks
  Append16(static_cast<uint32_t>(members.size()), &zip);
  Append16(static_cast<uint32_t>(members.size()), &zip);
  Append32(static_cast<uint32_t>(directory.size()), &zip);
  Append32(directory_at, &zip);
  Append16(0, &zip);
  return zip;
}

}  // namespace tissueform
