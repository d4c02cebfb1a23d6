// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/dicom_folder.h"

#include <algorithm>
#include <filesystem>
#include <gdcmReader.h>
#include <iterator>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"
#include "core/imaging/ct/dicom_tags.h"
#include "core/imaging/ct/file_bytes.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kDirectoryRecords = 0x00041220;
constexpr uint32_t kReferencedFile = 0x00041500;

struct Listing {
  std::vector<std::string> paths;
  int num_folders = 0;
  bool too_deep = false;
};

// `max_depth`: of folders below the given one; 0 lists only the folder itself.
absl::StatusOr<Listing> FilesIn(const std::string& folder, int max_depth,
                                const CtReadLimits& limits) {
  Listing listing;
  std::error_code error;  // exceptions of the file system hold paths
  fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied,
                                         error);
  for (const fs::recursive_directory_iterator end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;  // an entry that cannot be examined is neither
    if (entry->is_directory(unknown) && !entry->is_symlink(unknown)) {
      ++listing.num_folders;
      if (entry.depth() < max_depth) continue;
      entry.disable_recursion_pending();
      listing.too_deep = true;
    } else if (entry->is_regular_file(unknown)) {
      listing.paths.push_back(entry->path().string());
    }
    if (static_cast<int>(listing.paths.size()) > limits.max_files) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the folder holds more than ", limits.max_files, " files"));
    }
    if (max_depth > 0 && listing.num_folders > limits.max_folders) {
      return absl::ResourceExhaustedError(
          absl::StrCat("more than ", limits.max_folders,
                       " folders are below the given one; name the folder of the study"));
    }
  }
  if (error) return absl::InvalidArgumentError("the folder cannot be opened");
  std::sort(listing.paths.begin(), listing.paths.end());
  return listing;
}

DicomFolder ReadHeaders(const Listing& listing) {
  DicomFolder folder;
  folder.num_files = static_cast<int>(listing.paths.size());
  for (size_t i = 0; i < listing.paths.size(); ++i) {
    std::vector<DicomHeader> headers = ReadDicomHeaders(listing.paths[i]);
    folder.others += headers.empty() ? 1 : 0;
    folder.lfs_pointers += headers.empty() && IsLfsPointerFile(listing.paths[i]) ? 1 : 0;
    for (DicomHeader& header : headers) {
      header.file_number = static_cast<int>(i) + 1;
      folder.files.push_back(std::move(header));
    }
  }
  return folder;
}

bool HasCtImage(const DicomFolder& folder) {
  return std::any_of(folder.files.begin(), folder.files.end(), [](const DicomHeader& file) {
    return file.kind == DicomKind::kCtSlice || file.kind == DicomKind::kMultiFrame;
  });
}

// CDs are written in capitals, and mounted or copied in small letters, with or without a version.
std::string NameOnDisc(const std::string& path) {
  const std::string lower = absl::AsciiStrToLower(path);
  absl::string_view name = absl::StripSuffix(lower, ";1");
  return std::string(absl::StripSuffix(name, "."));
}

// The paths in a DICOMDIR are untrusted: they are compared with the listing, never opened.
int CountMissing(const std::string& directory, const Listing& listing) {
  gdcm::Reader reader;
  reader.SetFileName(directory.c_str());
  if (!reader.Read()) return 0;
  const std::string root = fs::path(directory).parent_path().string() + "/";
  std::set<std::string> present;
  for (const std::string& path : listing.paths) {
    if (path.starts_with(root)) present.insert(NameOnDisc(path.substr(root.size())));
  }
  std::set<std::string> missing;
  ForEachItem(reader.GetFile().GetDataSet(), kDirectoryRecords,
              [&](int /*index*/, const gdcm::DataSet& record) {
                const std::string name =
                    absl::StrReplaceAll(TextOf(record, kReferencedFile), {{"\\", "/"}});
                if (!name.empty() && !present.contains(NameOnDisc(name))) missing.insert(name);
              });
  return static_cast<int>(missing.size());
}

}  // namespace

absl::StatusOr<DicomFolder> ReadDicomFolder(const std::string& path, FoldersBelow below,
                                            const CtReadLimits& limits) {
  TF_ASSIGN_OR_RETURN(Listing listing, FilesIn(path, 0, limits));
  DicomFolder folder = ReadHeaders(listing);
  if (below == FoldersBelow::kWithoutCt && listing.num_folders > 0 && !HasCtImage(folder)) {
    TF_ASSIGN_OR_RETURN(listing, FilesIn(path, limits.max_folder_depth, limits));
    folder = ReadHeaders(listing);
    folder.num_folders = listing.num_folders;
    folder.too_deep = listing.too_deep;
  }
  if (listing.paths.empty()) {
    const std::string depth =
        listing.too_deep ? absl::StrCat(", to a depth of ", limits.max_folder_depth) : "";
    return absl::InvalidArgumentError(absl::StrCat(
        "the folder is empty",
        listing.num_folders > 0 ? ": no files in it or in the folders below it" + depth : "",
        "; name the folder that holds the CT series"));
  }
  for (const DicomHeader& file : folder.files) {
    if (file.kind == DicomKind::kDirectory) folder.num_missing += CountMissing(file.path, listing);
  }
  return folder;
}

}  // namespace tissueform
