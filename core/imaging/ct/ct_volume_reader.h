// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// Limits on what is read from outside. docs/ct-input.md lists the defaults.
struct CtReadLimits {
  int max_files = 20000;                        // in the folder, or in it and those below
  int max_folders = 2000;                       // below the folder that are searched
  int max_folder_depth = 8;                     // deeper folders are not searched
  int64_t max_file_bytes = int64_t{4} << 30;    // of all files that are read, together
  int64_t max_voxels = int64_t{1} << 30;        // of the volume
  int64_t max_memory_bytes = int64_t{8} << 30;  // of the process that reads
  int max_seconds = 300;                        // of its processor time
};

// Whether slices are one CT although their files name several series.
enum class JoinSeries {
  kAuto,    // those that fit by place, patient and kind
  kAlways,  // all of the folder
  kNever,
};

// What the numbers of the file are.
enum class CtValues {
  kAuto,  // HU if they can be: air and soft tissue are where they are in HU
  kHu,
  kGray,  // of a cone-beam scanner without calibration
};

// What the file cannot say; keys of the recipe have the same names.
struct CtReadOptions {
  // Added to the values of a file that does not state how they become HU: -1024 for HU + 1024.
  std::optional<double> hu_offset;

  // Three letters of L R A P S I: where in the patient the file's axes x, y, z grow toward.
  // Required where the file does not say how it lies in the patient; refused where it contradicts
  // what the file says.
  std::string axes;

  // Which of several DICOM series in a folder.
  std::optional<int> series_number;

  JoinSeries join_series = JoinSeries::kAuto;

  CtValues values = CtValues::kAuto;
  // In the file's gray values; found from the image if not given (core/imaging/ct/gray_values.h).
  std::optional<double> tissue_above_gray;
  std::optional<double> bone_above_gray;

  CtReadLimits limits;
};

// Reads a CT: a folder with a DICOM series, in it or in the folders below (a CD, a study), or one
// file of it (then the series of that file), or a file of NIfTI (.nii, .nii.gz), NRRD (.nrrd,
// .nhdr) or MetaImage (.mha, .mhd). Values are HU: DICOM's rescale slope and intercept, or those of
// NIfTI, are applied, then `hu_offset`; values under -1024 (outside the scanner's circle) become
// -1024. Where `values` is kGray, or kAuto and they cannot be HU, they stay as they are, within
// int16_t (CtVolume::has_gray_values). Places come from position and orientation, never from the
// slice thickness. The libraries (ITK, GDCM) work in a helper program within the limits. Any thread
// may call it.
//
// Errors: NotFound when there is no such path; ResourceExhausted beyond a limit; InvalidArgument
// for everything that cannot be used as a CT volume, in one line: what was found, where, what to
// do. Messages name files by their number in the folder, in order of names, and by the instance
// number, because names of files and folders may hold a patient's.
absl::StatusOr<CtVolume> ReadCtVolume(const std::string& path, const CtReadOptions& options = {});

}  // namespace tissueform
