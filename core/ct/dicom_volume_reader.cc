// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/dicom_volume_reader.h"

#include <algorithm>
#include <filesystem>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/ct/dicom_file.h"
#include "core/ct/dicom_series.h"
#include "core/ct/file_bytes.h"
#include "core/ct/hu_check.h"
#include "core/ct/patient_axes.h"
#include "core/mesh_payload/sha256.h"

namespace tissueform {
namespace {

absl::StatusOr<std::vector<std::string>> FilesIn(const std::string& folder, int max_files) {
  std::vector<std::string> paths;
  int num_folders = 0;
  std::error_code error;  // exceptions of the file system hold paths
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    num_folders += entry->is_directory(error) ? 1 : 0;
    if (entry->is_regular_file(error)) paths.push_back(entry->path().string());
    if (static_cast<int>(paths.size()) > max_files) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the folder holds more than ", max_files, " files"));
    }
  }
  if (error) return absl::InvalidArgumentError("the folder cannot be opened");
  if (paths.empty()) {
    return absl::InvalidArgumentError(
        num_folders == 0 ? "the folder is empty; name the folder that holds the CT series"
                         : absl::StrCat("the folder holds no files but ", num_folders,
                                        " folders; name the one that holds the CT series"));
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

struct Folder {
  std::vector<DicomHeader> files;
  int others = 0;
};

Folder ReadHeaders(const std::vector<std::string>& paths) {
  Folder folder;
  for (size_t i = 0; i < paths.size(); ++i) {
    std::optional<DicomHeader> header = ReadDicomHeader(paths[i]);
    folder.others += header ? 0 : 1;
    if (!header) continue;
    header->file_number = static_cast<int>(i) + 1;
    folder.files.push_back(*std::move(header));
  }
  return folder;
}

absl::StatusOr<SeriesChoice> ChoiceOf(const std::string& path, const Folder& folder,
                                      const CtReadOptions& options) {
  if (std::filesystem::is_directory(path)) return SeriesChoice{"", options.series_number};
  for (const DicomHeader& file : folder.files) {
    if (file.path == path) return SeriesChoice{file.series_uid, std::nullopt};
  }
  return absl::InvalidArgumentError(
      "the file is no DICOM file, and its ending is none of .nii .nii.gz .nrrd .nhdr .mha .mhd");
}

// A slice that nobody can read is missing from the stack, and it would be wrong to interpolate it
// in silence.
absl::Status CheckNoneDamaged(const std::vector<DicomHeader>& files, const DicomStack& stack) {
  if (stack.slice_origins_mm.empty()) return absl::OkStatus();
  for (const DicomHeader& file : files) {
    if (file.kind != DicomKind::kDamaged) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        NameOf(file), " is ", DescribeKind(file), ", and ", stack.notes.back(),
        "; export the series again, or take that file out of the folder to go without it"));
  }
  return absl::OkStatus();
}

absl::StatusOr<DicomStack> FindStack(const std::string& path, const CtReadOptions& options) {
  const std::filesystem::path place(path);
  const bool is_folder = std::filesystem::is_directory(place);
  const std::string folder_path = is_folder ? path : place.parent_path().string();
  TF_ASSIGN_OR_RETURN(const std::vector<std::string> paths,
                      FilesIn(folder_path, options.limits.max_files));
  const Folder folder = ReadHeaders(paths);
  TF_ASSIGN_OR_RETURN(const SeriesChoice choice, ChoiceOf(path, folder, options));
  if (folder.files.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("none of the ", folder.others, " files in the folder is a DICOM file"));
  }
  TF_ASSIGN_OR_RETURN(DicomStack stack, ChooseSeries(folder.files, choice));
  TF_RETURN_IF_ERROR(ArrangeStack(options.hu_offset.has_value(), &stack));
  TF_RETURN_IF_ERROR(CheckNoneDamaged(folder.files, stack));
  if (folder.others > 0) {
    stack.notes.push_back(absl::StrCat("left aside: ", folder.others, " files that are no DICOM"));
  }
  return stack;
}

absl::StatusOr<CtVolume> EmptyVolume(const DicomStack& stack, int64_t max_voxels) {
  const DicomHeader& first = stack.slices.front();
  CtVolume volume;
  volume.size = {first.columns, first.rows, static_cast<int>(stack.slices.size())};
  volume.spacing_mm = stack.spacing_mm;
  volume.origin_mm = *first.position_mm;
  volume.direction = stack.direction;
  volume.slice_origins_mm = stack.slice_origins_mm;
  volume.provenance.format = "DICOM";
  volume.provenance.num_files = volume.size[2];
  volume.provenance.gantry_tilt_deg = stack.gantry_tilt_deg;
  volume.provenance.notes = stack.notes;
  if (volume.num_voxels() > max_voxels) {
    return absl::ResourceExhaustedError(absl::StrCat("the series has ", volume.num_voxels(),
                                                     " voxels; at most ", max_voxels, " are read"));
  }
  volume.hu.reserve(static_cast<size_t>(volume.num_voxels()));
  return volume;
}

// Appends the slice's HU, and its file's digest. `offset` is the recipe's.
absl::Status AppendSlice(const DicomHeader& slice, double offset, int64_t* bytes_left,
                         CtVolume* volume, std::string* digests) {
  TF_ASSIGN_OR_RETURN(const std::string contents, ReadWholeFile(slice.path, bytes_left));
  absl::StrAppend(digests, Sha256Hex({contents}));
  TF_ASSIGN_OR_RETURN(const std::vector<double> values, DecodeDicomPixels(slice, contents));
  const double slope = slice.rescale_slope.value_or(1);
  const double intercept = slice.rescale_intercept.value_or(0) + offset;
  for (const double value : values) volume->hu.push_back(ToHu(slope * value + intercept));
  return absl::OkStatus();
}

absl::Status ReadSlices(const DicomStack& stack, double offset, int64_t max_bytes,
                        CtVolume* volume) {
  std::string digests;
  volume->hu.clear();
  for (const DicomHeader& slice : stack.slices) {
    TF_RETURN_IF_ERROR(AppendSlice(slice, offset, &max_bytes, volume, &digests));
  }
  volume->provenance.sha256 = Sha256Hex({digests});
  return absl::OkStatus();
}

bool StatesRescale(const DicomStack& stack) {
  return stack.slices.front().rescale_intercept.has_value();
}

// Where the files say how their values become HU and the recipe says it, too, the values decide: an
// offset is for those only that are no HU without it. Old scanners write RescaleIntercept 0 beside
// HU + 1024. CheckHu, without an offset, asks for one in just the cases in which it is taken here,
// so that no message takes back what another has asked for.
absl::Status CheckOffsetIsNeeded(const CtVolume& volume) {
  if (!CheckHu(volume.hu, std::nullopt).ok()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "the files state how their values become HU (RescaleSlope, RescaleIntercept), and so they "
      "are "
      "HU of a body in air; take \"hu_offset\" out of the recipe");
}

}  // namespace

absl::StatusOr<CtVolume> ReadDicomVolume(const std::string& path, const CtReadOptions& options) {
  TF_ASSIGN_OR_RETURN(const DicomStack stack, FindStack(path, options));
  TF_ASSIGN_OR_RETURN(CtVolume volume, EmptyVolume(stack, options.limits.max_voxels));
  TF_RETURN_IF_ERROR(PlaceVolume(true, "", options.axes, &volume));
  const int64_t max_bytes = options.limits.max_file_bytes;
  if (options.hu_offset && StatesRescale(stack)) {
    TF_RETURN_IF_ERROR(ReadSlices(stack, 0, max_bytes, &volume));
    TF_RETURN_IF_ERROR(CheckOffsetIsNeeded(volume));
    volume.provenance.notes.push_back(absl::StrCat(
        "the files state a rescale (RescaleIntercept ", *stack.slices.front().rescale_intercept,
        ") after which their values are no HU: \"hu_offset\" of the recipe is added"));
  }
  TF_RETURN_IF_ERROR(ReadSlices(stack, options.hu_offset.value_or(0), max_bytes, &volume));
  return volume;
}

}  // namespace tissueform
