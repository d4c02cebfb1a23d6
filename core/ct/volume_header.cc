// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/volume_header.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kMostLines = 1000;
constexpr size_t kMostLineBytes = 1 << 16;

// Splits "key: value"; key in lower case. NRRD's own "key:=value" is no field of the format.
bool SplitField(absl::string_view line, char separator, std::string* key, std::string* value) {
  const size_t place = line.find(separator);
  if (place == absl::string_view::npos || line[0] == '#') return false;
  if (separator == ':' && place + 1 < line.size() && line[place + 1] == '=') return false;
  *key = absl::AsciiStrToLower(absl::StripAsciiWhitespace(line.substr(0, place)));
  *value = std::string(absl::StripAsciiWhitespace(line.substr(place + 1)));
  return true;
}

absl::Status NotOfItsFormat(absl::string_view format) {
  return absl::InvalidArgumentError(
      absl::StrCat("the file ends like one of ", format, " but does not begin like one"));
}

// Read by ourselves before ITK opens anything: a header may name any file of the machine as its
// data, and the voxels of what it names would end up in a result that is passed on.
absl::Status SetDataFile(const std::string& path, const std::string& value, VolumeHeader* header) {
  if (value == "LOCAL" || value == "Local" || value == "local") return absl::OkStatus();
  const bool several = absl::StartsWith(value, "LIST") || absl::StrContains(value, '%');
  if (several) {
    return absl::InvalidArgumentError(
        "the voxels are spread over several files; convert the volume to one file");
  }
  const std::filesystem::path name(value);
  if (name.has_parent_path() || value == "." || value == ".." || value.empty()) {
    return absl::InvalidArgumentError(
        "the header names a data file in another folder; put it beside the header and name it "
        "without a folder");
  }
  header->data_path = (std::filesystem::path(path).parent_path() / name).string();
  return absl::OkStatus();
}

absl::Status ReadNrrd(std::istream& stream, const std::string& path, VolumeHeader* header) {
  std::string line;
  if (!std::getline(stream, line) || !absl::StartsWith(line, "NRRD000")) {
    return NotOfItsFormat("NRRD");
  }
  for (int count = 0; count < kMostLines && std::getline(stream, line); ++count) {
    absl::StripTrailingAsciiWhitespace(&line);
    if (line.empty() || line.size() > kMostLineBytes) break;
    std::string key;
    std::string value;
    if (!SplitField(line, ':', &key, &value)) continue;
    if (key == "space") header->orientation = value;
    if (key == "data file" || key == "datafile") {
      TF_RETURN_IF_ERROR(SetDataFile(path, value, header));
    }
  }
  return absl::OkStatus();
}

absl::Status ReadMetaImage(std::istream& stream, const std::string& path, VolumeHeader* header) {
  std::string line;
  for (int count = 0; count < kMostLines && std::getline(stream, line); ++count) {
    std::string key;
    std::string value;
    if (line.empty() || line.size() > kMostLineBytes || !SplitField(line, '=', &key, &value)) {
      break;
    }
    if (key == "anatomicalorientation") header->orientation = value;
    if (key == "compresseddata") header->compressed = absl::StartsWith(value, "T");
    if (key == "compresseddatasize" && !absl::SimpleAtoi(value, &header->compressed_bytes)) break;
    if (key != "elementdatafile") continue;  // which is always the last
    stream.clear();  // the file may end here, without a line's end: then there is no voxel
    header->data_offset = static_cast<size_t>(stream.tellg());
    return SetDataFile(path, value, header);
  }
  return NotOfItsFormat("MetaImage");
}

}  // namespace

std::optional<VolumeFormat> VolumeFormatOfPath(const std::string& path) {
  const std::string lower = absl::AsciiStrToLower(path);
  const auto ends = [&lower](absl::string_view ending) { return absl::EndsWith(lower, ending); };
  if (ends(".nii") || ends(".nii.gz")) return VolumeFormat::kNifti;
  if (ends(".nrrd") || ends(".nhdr")) return VolumeFormat::kNrrd;
  if (ends(".mha") || ends(".mhd")) return VolumeFormat::kMetaImage;
  return std::nullopt;
}

absl::StatusOr<VolumeHeader> ReadVolumeHeader(const std::string& path, VolumeFormat format) {
  std::ifstream stream(path, std::ios::binary);
  VolumeHeader header;
  if (format == VolumeFormat::kNrrd) TF_RETURN_IF_ERROR(ReadNrrd(stream, path, &header));
  if (format == VolumeFormat::kMetaImage) TF_RETURN_IF_ERROR(ReadMetaImage(stream, path, &header));
  return header;
}

}  // namespace tissueform
