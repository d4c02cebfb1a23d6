// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/volume_header.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kMaxLines = 1000;
constexpr size_t kMaxLineBytes = 1 << 16;

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
absl::Status AddDataFile(const std::string& path, const std::string& value, VolumeHeader* header) {
  const std::filesystem::path name(value);
  if (name.has_parent_path() || value == "." || value == ".." || value.empty()) {
    return absl::InvalidArgumentError(
        "the header names a data file in another folder; put it beside the header and name it "
        "without a folder");
  }
  if (static_cast<int>(header->data_paths.size()) >= kMaxDataFiles) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the header names more than ", kMaxDataFiles, " data files"));
  }
  header->data_paths.push_back((std::filesystem::path(path).parent_path() / name).string());
  return absl::OkStatus();
}

bool IsLocal(const std::string& value) {
  return value == "LOCAL" || value == "Local" || value == "local";
}

// "slice%03d.raw 1 93 1", maybe with the dimension of each file: name, first, last, step.
struct NumberedFiles {
  std::string before;  // the number
  std::string after;
  bool zeros = false;  // pad with
  size_t width = 0;
  int first = 0;
  int last = 0;
  int step = 1;
};

// Takes the digits that `text` begins with.
absl::string_view TakeDigits(absl::string_view* text) {
  const size_t count = std::min(text->find_first_not_of("0123456789"), text->size());
  const absl::string_view digits = text->substr(0, count);
  text->remove_prefix(count);
  return digits;
}

// The library behind ITK hands the name to printf: nothing but one %d with a width may be in it.
std::optional<NumberedFiles> ParseNumbered(const std::string& value) {
  const std::vector<std::string> words =
      absl::StrSplit(value, absl::ByAnyChar(" \t"), absl::SkipEmpty());
  NumberedFiles files;
  if (words.size() < 4 || words.size() > 5) return std::nullopt;
  const size_t percent = words[0].find('%');
  files.before = words[0].substr(0, percent);
  absl::string_view rest = absl::string_view(words[0]).substr(percent + 1);
  const absl::string_view width = TakeDigits(&rest);
  if (width.size() > 2 || !absl::ConsumePrefix(&rest, "d") || absl::StrContains(rest, '%')) {
    return std::nullopt;
  }
  files.after = std::string(rest);
  files.zeros = absl::StartsWith(width, "0");
  if (!width.empty() && !absl::SimpleAtoi(width, &files.width)) return std::nullopt;
  const bool numbers = absl::SimpleAtoi(words[1], &files.first) &&
                       absl::SimpleAtoi(words[2], &files.last) &&
                       absl::SimpleAtoi(words[3], &files.step);
  if (!numbers || files.first < 0 || files.last < files.first || files.step < 1) {
    return std::nullopt;
  }
  return files;
}

absl::Status AddNumbered(const std::string& path, const std::string& value, VolumeHeader* header) {
  const std::optional<NumberedFiles> files = ParseNumbered(value);
  if (!files) {
    return absl::InvalidArgumentError(
        "the header's data files are not numbered like \"slice%03d.raw 1 93 1\" (name, first, last "
        "and step)");
  }
  for (int64_t number = files->first; number <= files->last; number += files->step) {
    std::string digits = absl::StrCat(number);
    if (digits.size() < files->width) {
      digits.insert(0, files->width - digits.size(), files->zeros ? '0' : ' ');
    }
    TF_RETURN_IF_ERROR(
        AddDataFile(path, absl::StrCat(files->before, digits, files->after), header));
  }
  return absl::OkStatus();
}

// A name a line to the end of the header's file.
absl::Status AddListed(std::istream& stream, const std::string& path, VolumeHeader* header) {
  std::string line;
  while (std::getline(stream, line)) {
    if (line.size() > kMaxLineBytes) return NotOfItsFormat("NRRD");
    absl::StripAsciiWhitespace(&line);
    if (!line.empty()) TF_RETURN_IF_ERROR(AddDataFile(path, line, header));
  }
  if (header->data_paths.empty()) {
    return absl::InvalidArgumentError("the header's list of data files is empty");
  }
  return absl::OkStatus();
}

absl::Status AddDataFilesOfNrrd(std::istream& stream, const std::string& path,
                                const std::string& value, VolumeHeader* header) {
  header->data_paths.clear();  // the last of two fields counts
  if (IsLocal(value)) return absl::OkStatus();
  if (absl::StartsWith(value, "LIST")) return AddListed(stream, path, header);
  if (absl::StrContains(value, '%')) return AddNumbered(path, value, header);
  return AddDataFile(path, value, header);
}

absl::Status AddDataFileOfMetaImage(const std::string& path, const std::string& value,
                                    VolumeHeader* header) {
  if (IsLocal(value)) return absl::OkStatus();
  if (absl::StartsWith(value, "LIST") || absl::StrContains(value, '%')) {
    return absl::InvalidArgumentError(
        "the voxels are spread over several files; convert the volume to one file");
  }
  return AddDataFile(path, value, header);
}

absl::Status ReadNrrd(std::istream& stream, const std::string& path, VolumeHeader* header) {
  std::string line;
  if (!std::getline(stream, line) || !absl::StartsWith(line, "NRRD000")) {
    return NotOfItsFormat("NRRD");
  }
  for (int count = 0; count < kMaxLines && std::getline(stream, line); ++count) {
    absl::StripTrailingAsciiWhitespace(&line);
    if (line.empty() || line.size() > kMaxLineBytes) break;
    std::string key;
    std::string value;
    if (!SplitField(line, ':', &key, &value)) continue;
    if (key == "space") header->orientation = value;
    if (key == "data file" || key == "datafile") {
      TF_RETURN_IF_ERROR(AddDataFilesOfNrrd(stream, path, value, header));
    }
  }
  return absl::OkStatus();
}

absl::Status ReadMetaImage(std::istream& stream, const std::string& path, VolumeHeader* header) {
  std::string line;
  for (int count = 0; count < kMaxLines && std::getline(stream, line); ++count) {
    std::string key;
    std::string value;
    if (line.empty() || line.size() > kMaxLineBytes || !SplitField(line, '=', &key, &value)) {
      break;
    }
    if (key == "anatomicalorientation") header->orientation = value;
    if (key == "compresseddata") header->compressed = absl::StartsWith(value, "T");
    if (key == "compresseddatasize" && !absl::SimpleAtoi(value, &header->compressed_bytes)) break;
    if (key != "elementdatafile") continue;  // which is always the last
    stream.clear();  // the file may end here, without a line's end: then there is no voxel
    header->data_offset = static_cast<size_t>(stream.tellg());
    return AddDataFileOfMetaImage(path, value, header);
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
