// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/bare_label_map.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <vector>
#include <zlib.h>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxHeaderBytes = size_t{1} << 20;
constexpr size_t kMaxUnpackedBytes = size_t{1} << 30;  // LabelLimits::max_file_bytes

constexpr int kGzip = 15 + 16;  // window bits of zlib, and its mark for gzip
constexpr int kPackLevel = 1;
constexpr int kMemoryLevel = 8;  // zlib's default

// Fields of NRRD that place and decode the voxels.
constexpr std::array<absl::string_view, 17> kNrrdFields = {
    "type",      "dimension",        "space",        "space dimension", "sizes",
    "kinds",     "space directions", "space origin", "space units",     "measurement frame",
    "endian",    "encoding",         "spacings",     "centers",         "centerings",
    "byte skip", "line skip"};
constexpr std::array<absl::string_view, 4> kSegmentKeys = {"_Name", "_LabelValue", "_Layer",
                                                           "_Tags"};
// Keys of MetaImage that place and decode the voxels.
constexpr std::array<absl::string_view, 20> kMetaKeys = {"ObjectType",
                                                         "NDims",
                                                         "BinaryData",
                                                         "BinaryDataByteOrderMSB",
                                                         "ElementByteOrderMSB",
                                                         "CompressedData",
                                                         "CompressedDataSize",
                                                         "TransformMatrix",
                                                         "Rotation",
                                                         "Orientation",
                                                         "Offset",
                                                         "Position",
                                                         "Origin",
                                                         "AnatomicalOrientation",
                                                         "ElementSpacing",
                                                         "ElementSize",
                                                         "DimSize",
                                                         "ElementNumberOfChannels",
                                                         "ElementType",
                                                         "ElementDataFile"};

struct NiftiText {
  size_t at;
  size_t bytes;
};
// data_type, db_name, descrip, aux_file, intent_name (nifti1.h).
constexpr std::array<NiftiText, 5> kNiftiTexts = {
    {{4, 10}, {14, 18}, {148, 80}, {228, 24}, {328, 16}}};
constexpr size_t kNiftiHeaderBytes = 348;
constexpr size_t kNiftiOffsetAt = 108;

template <typename Names>
bool Holds(const Names& names, absl::string_view name) {
  return std::ranges::find(names, name) != names.end();
}

absl::Status Damaged() {
  return absl::InvalidArgumentError(
      "cannot use the label map: the file is cut off, damaged, or not of its ending's format");
}

absl::Status NeedsOneFile() {
  return absl::InvalidArgumentError(
      "cannot send the label map: its voxels are in a file of their own; store it as one .nrrd, "
      ".nii.gz or .mha");
}

bool IsSegmentKey(absl::string_view key) {
  if (!absl::ConsumePrefix(&key, "Segment")) return false;
  const size_t digits = std::min(key.find_first_not_of("0123456789"), key.size());
  return digits > 0 && Holds(kSegmentKeys, key.substr(digits));
}

absl::StatusOr<std::string> BareNrrd(absl::string_view file) {
  const absl::string_view start = file.substr(0, kMaxHeaderBytes);
  size_t end = start.find("\n\n");
  size_t data = end + 2;
  if (const size_t dos = start.find("\r\n\r\n"); dos < end) {
    end = dos;
    data = dos + 4;
  }
  if (end == absl::string_view::npos || !absl::StartsWith(file, "NRRD")) return Damaged();
  std::string bare;
  for (absl::string_view line : absl::StrSplit(start.substr(0, end), '\n')) {
    line = absl::StripSuffix(line, "\r");
    const size_t colon = line.find(':');
    const std::string field = absl::AsciiStrToLower(line.substr(0, std::min(colon, line.size())));
    if (field == "data file" || field == "datafile") return NeedsOneFile();
    const bool is_key = absl::StartsWith(line.substr(std::min(colon, line.size())), ":=");
    const bool is_kept =
        bare.empty() || (is_key ? IsSegmentKey(line.substr(0, colon)) : Holds(kNrrdFields, field));
    if (is_kept) absl::StrAppend(&bare, line, "\n");
  }
  return absl::StrCat(bare, "\n", file.substr(data));
}

absl::StatusOr<std::string> BareMetaImage(absl::string_view file) {
  std::string bare;
  size_t at = 0;
  while (at < kMaxHeaderBytes) {
    const size_t end = file.find('\n', at);
    if (end == absl::string_view::npos) return Damaged();
    const absl::string_view line = file.substr(at, end - at);
    at = end + 1;
    const std::pair<absl::string_view, absl::string_view> parts =
        absl::StrSplit(line, absl::MaxSplits('=', 1));
    const absl::string_view key = absl::StripAsciiWhitespace(parts.first);
    if (Holds(kMetaKeys, key)) absl::StrAppend(&bare, line, "\n");
    if (key != "ElementDataFile") continue;
    if (absl::StripAsciiWhitespace(parts.second) != "LOCAL") return NeedsOneFile();
    return absl::StrCat(bare, file.substr(at));
  }
  return Damaged();
}

// Where the voxels begin; 0 for a header that is not NIfTI-1's.
size_t VoxelOffset(const std::string& file) {
  if (file.size() < kNiftiHeaderBytes + 4) return 0;
  uint32_t header_bytes = 0;
  uint32_t offset_bits = 0;
  std::memcpy(&header_bytes, file.data(), sizeof(header_bytes));
  std::memcpy(&offset_bits, file.data() + kNiftiOffsetAt, sizeof(offset_bits));
  if (header_bytes != kNiftiHeaderBytes) {
    header_bytes = __builtin_bswap32(header_bytes);
    offset_bits = __builtin_bswap32(offset_bits);
  }
  const auto offset = std::bit_cast<float>(offset_bits);
  const bool is_usable = header_bytes == kNiftiHeaderBytes && offset >= kNiftiHeaderBytes + 4 &&
                         offset <= static_cast<float>(file.size());
  return is_usable ? static_cast<size_t>(offset) : 0;
}

// Of extensions only the elements of a label table ("<Label Key=...>name</Label>"), where they are:
// label readers search the text before the voxels for them.
std::string OnlyLabels(absl::string_view extensions) {
  constexpr absl::string_view kBegin = "<Label ";
  constexpr absl::string_view kEnd = "</Label>";
  std::string kept(extensions.size(), '\0');
  size_t next = 0;
  for (size_t at = extensions.find(kBegin); at != absl::string_view::npos; at = next) {
    next = extensions.find(kBegin, at + 1);
    const size_t end = extensions.find(kEnd, at);
    if (end == absl::string_view::npos) break;
    if (next < end) continue;  // never closed
    const size_t count = end + kEnd.size() - at;
    kept.replace(at, count, extensions.data() + at, count);
  }
  return kept;
}

absl::StatusOr<std::string> BareNifti(std::string file) {
  const size_t offset = VoxelOffset(file);
  if (offset == 0) return Damaged();
  for (const NiftiText& text : kNiftiTexts) file.replace(text.at, text.bytes, text.bytes, '\0');
  // The flag that announces extensions goes with them.
  const size_t count = offset - kNiftiHeaderBytes;
  const std::string labels = OnlyLabels(absl::string_view(file).substr(kNiftiHeaderBytes, count));
  file.replace(kNiftiHeaderBytes, count, labels);
  return file;
}

absl::StatusOr<std::string> Unpacked(std::string packed) {
  z_stream stream{};
  if (inflateInit2(&stream, kGzip) != Z_OK) return Damaged();
  stream.next_in = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_in = static_cast<uInt>(packed.size());
  std::string unpacked;
  int result = Z_OK;
  while (result == Z_OK && unpacked.size() < kMaxUnpackedBytes) {
    const size_t before = unpacked.size();
    unpacked.resize(before + kMaxHeaderBytes);
    stream.next_out = reinterpret_cast<Bytef*>(unpacked.data() + before);
    stream.avail_out = static_cast<uInt>(kMaxHeaderBytes);
    result = inflate(&stream, Z_NO_FLUSH);
    unpacked.resize(unpacked.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (result != Z_STREAM_END) return Damaged();
  return unpacked;
}

// As gzip, without a time: the same bytes give the same.
absl::StatusOr<std::string> Packed(std::string bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, kPackLevel, Z_DEFLATED, kGzip, kMemoryLevel, Z_DEFAULT_STRATEGY) !=
      Z_OK) {
    return absl::ResourceExhaustedError("no memory to compress the label map");
  }
  std::string packed(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int result = deflate(&stream, Z_FINISH);
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  if (result == Z_STREAM_END) return packed;
  return absl::InternalError("cannot compress the label map");
}

absl::StatusOr<BareLabelMap> BareNiftiFile(std::string file) {
  if (file.size() > kMaxUnpackedBytes) return Damaged();
  const bool is_gzip = absl::StartsWith(file, "\x1f\x8b");
  if (is_gzip) {
    TF_ASSIGN_OR_RETURN(file, Unpacked(std::move(file)));
  }
  TF_ASSIGN_OR_RETURN(std::string bare, BareNifti(std::move(file)));
  TF_ASSIGN_OR_RETURN(std::string packed, Packed(std::move(bare)));
  return BareLabelMap{".nii.gz", std::move(packed)};
}

}  // namespace

absl::StatusOr<BareLabelMap> WithoutText(absl::string_view path, std::string file) {
  if (absl::EndsWithIgnoreCase(path, ".nrrd")) {
    TF_ASSIGN_OR_RETURN(std::string bare, BareNrrd(file));
    return BareLabelMap{".nrrd", std::move(bare)};
  }
  if (absl::EndsWithIgnoreCase(path, ".mha")) {
    TF_ASSIGN_OR_RETURN(std::string bare, BareMetaImage(file));
    return BareLabelMap{".mha", std::move(bare)};
  }
  if (absl::EndsWithIgnoreCase(path, ".nii") || absl::EndsWithIgnoreCase(path, ".nii.gz")) {
    return BareNiftiFile(std::move(file));
  }
  if (absl::EndsWithIgnoreCase(path, ".nhdr") || absl::EndsWithIgnoreCase(path, ".mhd")) {
    return NeedsOneFile();
  }
  return absl::InvalidArgumentError(
      "cannot send the label map: it is not .nrrd, .nii, .nii.gz or .mha; convert a DICOM SEG to "
      ".seg.nrrd, or build on this machine, without --server");
}

}  // namespace tissueform
