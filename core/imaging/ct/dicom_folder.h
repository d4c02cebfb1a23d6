// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/dicom_header.h"

namespace tissueform {

// The DICOM files of a folder, or of a CD or a study with the folders below it.
struct DicomFolder {
  std::vector<DicomHeader> files;  // in the order of their paths, which gives their file_number
  int num_files = 0;               // of any kind
  int others = 0;                  // files that are not DICOM
  int lfs_pointers = 0;            // of these: texts in place of files that were not fetched
  int num_folders = 0;             // below the given folder that were searched
  bool too_deep = false;           // folders deeper than max_folder_depth were left out
  int num_missing = 0;             // files that a DICOMDIR names and that do not exist
};

// Which folders below the given one are read.
enum class FoldersBelow {
  kNever,      // a file of the folder was named
  kWithoutCt,  // all, if the folder itself has no CT image
};

// Reads the headers of a folder's files. Symbolic links to folders are not followed. A DICOMDIR
// only shows which files are missing: the headers of the files decide, as the DICOMDIR may be
// outdated. In a helper program only. Internal to core/imaging/ct.
//
// Errors: InvalidArgument for a folder without files; ResourceExhausted beyond the limits.
absl::StatusOr<DicomFolder> ReadDicomFolder(const std::string& folder, FoldersBelow below,
                                            const CtReadLimits& limits);

}  // namespace tissueform
