// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/zip_inputs.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/labels/structures.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 6> kVolumeEndings = {".nii",  ".nii.gz", ".nrrd",
                                                       ".nhdr", ".mha",    ".mhd"};
constexpr int kMaxListed = 8;
constexpr std::streamoff kDicomMagicAt = 128;

struct ZipFile {
  std::string path;
  int number = 0;      // in order of names
  std::string ending;  // of a volume, else empty
};

std::string VolumeEnding(const std::string& path) {
  std::string longest;
  for (const char* ending : kVolumeEndings) {
    if (absl::EndsWithIgnoreCase(path, ending)) longest = ending;
  }
  return longest;
}

std::vector<ZipFile> FilesOf(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;  // exceptions of the file system hold paths
  fs::recursive_directory_iterator entry(folder, error);
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    if (entry->is_regular_file(unknown)) paths.push_back(entry->path().string());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<ZipFile> files;
  files.reserve(paths.size());
  for (const std::string& path : paths) {
    files.push_back({path, static_cast<int>(files.size()) + 1, VolumeEnding(path)});
  }
  return files;
}

bool IsDicom(const std::string& path) {
  std::array<char, 4> magic{};
  std::ifstream stream(path, std::ios::binary);
  stream.seekg(kDicomMagicAt);
  stream.read(magic.data(), magic.size());
  return absl::string_view(magic.data(), magic.size()) == "DICM";
}

// "file 2 (.nrrd, 12.5 MB), file 7 (.nii.gz, 8.0 MB)".
std::string Listed(const std::vector<ZipFile>& files) {
  std::string text;
  for (const ZipFile& file : files) {
    if (&file - files.data() == kMaxListed) return text + ", ...";
    std::error_code error;
    const auto bytes = static_cast<double>(fs::file_size(file.path, error));
    absl::StrAppendFormat(&text, "%sfile %d (%s, %.1f MB)", text.empty() ? "" : ", ", file.number,
                          file.ending.empty() ? "no volume" : file.ending, bytes / 1e6);
  }
  return text;
}

absl::Status Several(const char* what, const std::vector<ZipFile>& files, const char* besides) {
  return absl::InvalidArgumentError(
      absl::StrCat("cannot use the zip: it holds ", files.size(), " ", what, besides, ": ",
                   Listed(files), ", in the order of names; unpack it, and name one"));
}

std::vector<ZipFile> VolumesOf(const std::vector<ZipFile>& files) {
  std::vector<ZipFile> volumes;
  for (const ZipFile& file : files) {
    if (!file.ending.empty()) volumes.push_back(file);
  }
  return volumes;
}

absl::StatusOr<std::string> CtIn(const std::string& folder) {
  const std::vector<ZipFile> files = FilesOf(folder);
  const std::vector<ZipFile> volumes = VolumesOf(files);
  if (volumes.empty()) return folder;
  const bool has_dicom = std::any_of(files.begin(), files.end(),
                                     [](const ZipFile& file) { return IsDicom(file.path); });
  if (volumes.size() > 1 || has_dicom) {
    return Several(volumes.size() > 1 ? "volumes" : "volume", volumes,
                   has_dicom ? " and DICOM files" : "");
  }
  return volumes.front().path;
}

// Volumes of one folder, at least one with the name of a structure: one mask a file.
bool AreMasks(const std::vector<ZipFile>& maps) {
  const fs::path folder = fs::path(maps.front().path).parent_path();
  const bool in_one = std::all_of(maps.begin(), maps.end(), [&](const ZipFile& map) {
    return !map.ending.empty() && fs::path(map.path).parent_path() == folder;
  });
  return in_one && std::any_of(maps.begin(), maps.end(), [](const ZipFile& map) {
           const std::string name = fs::path(map.path).filename().string();
           const size_t stem = name.size() - map.ending.size();
           return StructureOfName(absl::string_view(name).substr(0, stem)).has_value();
         });
}

absl::StatusOr<std::string> LabelsIn(const std::string& folder) {
  const std::vector<ZipFile> files = FilesOf(folder);
  std::vector<ZipFile> maps = VolumesOf(files);
  if (maps.empty()) maps = files;  // a DICOM SEG
  if (maps.size() == 1) return maps.front().path;
  if (AreMasks(maps)) return fs::path(maps.front().path).parent_path().string();
  return Several("files that may be the label map", maps, "");
}

absl::StatusOr<std::string> SurfacesIn(const std::string& folder) {
  std::vector<ZipFile> found;
  for (const ZipFile& file : FilesOf(folder)) {
    if (absl::EndsWithIgnoreCase(file.path, ".json") &&
        !absl::EndsWithIgnoreCase(file.path, ".mrk.json")) {
      found.push_back(file);
    }
  }
  if (found.size() == 1) return found.front().path;
  return absl::InvalidArgumentError(absl::StrCat("cannot use the zip: it holds ", found.size(),
                                                 " .json files; exactly one must name the "
                                                 "surfaces"));
}

}  // namespace

absl::StatusOr<std::string> ZipInputs::Resolve(const std::string& path, ZipContent content) {
  if (!IsZip(path)) return path;
  TF_ASSIGN_OR_RETURN(UnpackedZip zip, UnpackedZip::Unpack(path, parent_));
  const std::string folder = zip.folder();
  unpacked_.push_back(std::move(zip));
  if (content == ZipContent::kCt) return CtIn(folder);
  return content == ZipContent::kLabels ? LabelsIn(folder) : SurfacesIn(folder);
}

}  // namespace tissueform
