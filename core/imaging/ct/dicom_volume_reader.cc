// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/dicom_volume_reader.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/ct/dicom_folder.h"
#include "core/imaging/ct/dicom_header.h"
#include "core/imaging/ct/dicom_series.h"
#include "core/imaging/ct/file_bytes.h"
#include "core/imaging/ct/hu_check.h"
#include "core/imaging/ct/patient_axes.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

// Whether a series without RescaleIntercept is one that the user means.
bool MayLackRescale(const CtReadOptions& options) {
  return options.hu_offset.has_value() || options.values == CtValues::kGray;
}

absl::StatusOr<SeriesChoice> ChoiceOf(const std::string& path, const DicomFolder& folder,
                                      const CtReadOptions& options) {
  if (std::filesystem::is_directory(path)) {
    return SeriesChoice{0, options.series_number, options.join_series, MayLackRescale(options)};
  }
  for (const DicomHeader& file : folder.files) {
    if (file.path != path) continue;
    return SeriesChoice{file.file_number, std::nullopt, options.join_series,
                        MayLackRescale(options)};
  }
  return absl::InvalidArgumentError(
      "the file is not a DICOM file, and its ending is not .nii .nii.gz .nrrd .nhdr .mha or .mhd");
}

// Where a slice lies, as far as a copy of its file would say the same.
auto PlaceKey(const DicomHeader& header) {
  const Eigen::Vector3d place = header.position_mm.value_or(Eigen::Vector3d::Zero());
  return std::tuple(header.series_uid, header.instance_number, place.x(), place.y(), place.z());
}

// Leaves out files whose bytes are those of another, as folders hold them that were merged. Only
// files of one series and place are compared.
int DropCopies(int64_t max_bytes, std::vector<DicomHeader>* files) {
  std::map<decltype(PlaceKey(files->front())), std::set<std::string>> seen;
  std::map<decltype(PlaceKey(files->front())), int> count;
  for (const DicomHeader& file : *files) ++count[PlaceKey(file)];
  const auto is_copy = [&](const DicomHeader& file) {
    if (file.kind != DicomKind::kCtSlice || file.num_frames > 1) return false;
    if (count[PlaceKey(file)] < 2) return false;
    const absl::StatusOr<std::string> contents = ReadWholeFile(file.path, &max_bytes);
    return contents.ok() && !seen[PlaceKey(file)].insert(Sha256Hex({*contents})).second;
  };
  const auto first = std::stable_partition(files->begin(), files->end(),
                                           [&](const DicomHeader& file) { return !is_copy(file); });
  const auto copies = static_cast<int>(files->end() - first);
  files->erase(first, files->end());
  return copies;
}

// A slice that cannot be read is missing from the stack, and it would be wrong to interpolate it
// silently.
absl::Status CheckNoneDamaged(const std::vector<DicomHeader>& files, const DicomStack& stack) {
  if (stack.slice_origins_mm.empty()) return absl::OkStatus();
  for (const DicomHeader& file : files) {
    if (file.kind != DicomKind::kDamaged) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(NameOf(file), " is ", DescribeKind(file), ", and ", stack.notes.back(),
                     "; export the series again, or remove that file to continue without it"));
  }
  return absl::OkStatus();
}

// What an incomplete copy of a disc or a repository lacks; empty where nothing is missing.
std::string DescribeMissing(const DicomFolder& folder) {
  if (folder.lfs_pointers > 0) {
    return absl::StrCat(folder.lfs_pointers, " of ", folder.num_files,
                        " files are git-LFS pointers, not the files themselves; run \"git lfs "
                        "pull\" in their repository");
  }
  if (folder.num_missing == 0) return "";
  return absl::StrCat("the DICOMDIR lists ", folder.num_missing,
                      folder.num_missing > 1 ? " files that are" : " file that is",
                      " missing: copy the whole disc");
}

std::string DescribeSearch(const DicomFolder& folder, int max_depth) {
  return absl::StrCat("searched ", folder.num_files, " files and ", folder.num_folders,
                      folder.num_folders > 1 ? " folders" : " folder", " below the given one",
                      folder.too_deep ? absl::StrCat(", to a depth of ", max_depth) : "");
}

absl::Status WithSearch(const absl::Status& status, const DicomFolder& folder, int max_depth) {
  std::string message(status.message());
  if (folder.num_folders > 0) {
    absl::StrAppend(&message, "; ", DescribeSearch(folder, max_depth),
                    "; or name the folder of one series");
  }
  const std::string missing = DescribeMissing(folder);
  if (!missing.empty()) absl::StrAppend(&message, "; ", missing);
  return {status.code(), message};
}

void AddFolderNotes(const DicomFolder& folder, int max_depth, int copies, DicomStack* stack) {
  if (folder.num_folders > 0) {
    const std::optional<int> number = stack->slices.front().series_number;
    stack->notes.push_back(absl::StrFormat(
        "%s; the CT is %s (%d slices, %.2f mm apart)", DescribeSearch(folder, max_depth),
        number ? absl::StrCat("series ", *number) : "a series without number", stack->slices.size(),
        stack->spacing_mm[2]));
  }
  const std::string missing = DescribeMissing(folder);
  if (!missing.empty()) stack->notes.push_back(missing);
  if (copies > 0) {
    stack->notes.push_back(absl::StrCat("ignored: ", copies, " files that are copies of others"));
  }
  if (folder.others > 0) {
    stack->notes.push_back(absl::StrCat("ignored: ", folder.others, " files that are not DICOM"));
  }
}

absl::StatusOr<DicomStack> FindStack(const std::string& path, const CtReadOptions& options) {
  const std::filesystem::path place(path);
  const bool is_folder = std::filesystem::is_directory(place);
  const std::string folder_path = is_folder ? path : place.parent_path().string();
  const int max_depth = options.limits.max_folder_depth;
  TF_ASSIGN_OR_RETURN(
      DicomFolder folder,
      ReadDicomFolder(folder_path, is_folder ? FoldersBelow::kWithoutCt : FoldersBelow::kNever,
                      options.limits));
  TF_ASSIGN_OR_RETURN(const SeriesChoice choice, ChoiceOf(path, folder, options));
  if (folder.files.empty()) {
    return WithSearch(
        absl::InvalidArgumentError(absl::StrCat("none of the ", folder.others,
                                                " files in the folder is a DICOM file; unpack "
                                                "archives, and name the folder of the CT series")),
        folder, max_depth);
  }
  const int copies = DropCopies(options.limits.max_file_bytes, &folder.files);
  absl::StatusOr<DicomStack> stack = ChooseSeries(folder.files, choice);
  if (!stack.ok()) return WithSearch(stack.status(), folder, max_depth);
  const absl::Status arranged =
      ArrangeStack(options.hu_offset.has_value() || options.values != CtValues::kHu, &*stack);
  if (!arranged.ok() && options.join_series == JoinSeries::kAlways) {
    return absl::Status(arranged.code(),
                        absl::StrCat(arranged.message(),
                                     "; or leave \"join_series\": \"always\" out of the "
                                     "recipe, so that scans are separated"));
  }
  TF_RETURN_IF_ERROR(arranged);
  TF_RETURN_IF_ERROR(CheckNoneDamaged(folder.files, *stack));
  AddFolderNotes(folder, max_depth, copies, &*stack);
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
  volume.frame_uid = stack.slices.front().frame_uid;
  std::set<int> files;
  for (const DicomHeader& slice : stack.slices) files.insert(slice.file_number);
  volume.provenance.num_files = static_cast<int>(files.size());
  volume.provenance.gantry_tilt_deg = stack.gantry_tilt_deg;
  volume.provenance.notes = stack.notes;
  if (volume.num_voxels() > max_voxels) {
    return absl::ResourceExhaustedError(absl::StrCat("the series has ", volume.num_voxels(),
                                                     " voxels; at most ", max_voxels, " are read"));
  }
  volume.hu.resize(static_cast<size_t>(volume.num_voxels()));
  return volume;
}

// Lays the values of a slice's image into the volume. `image` begins with the slice's first pixel;
// `offset` is the recipe's.
void TakeSlice(const DicomHeader& slice, const float* image, size_t k, double offset,
               CtVolume* volume) {
  const double slope = slice.rescale_slope.value_or(1);
  const double intercept = slice.rescale_intercept.value_or(0) + offset;
  const size_t count = static_cast<size_t>(slice.rows) * static_cast<size_t>(slice.columns);
  for (size_t i = 0; i < count; ++i) {
    volume->hu[k * count + i] = ToStored(slope * static_cast<double>(image[i]) + intercept);
  }
}

// Each file is read once, in any order of its frames.
absl::Status ReadSlices(const DicomStack& stack, double offset, int64_t max_bytes,
                        CtVolume* volume) {
  std::map<int, std::vector<size_t>> slices_of_file;
  std::vector<int> files;  // in the order of the volume
  for (size_t k = 0; k < stack.slices.size(); ++k) {
    std::vector<size_t>& slices = slices_of_file[stack.slices[k].file_number];
    if (slices.empty()) files.push_back(stack.slices[k].file_number);
    slices.push_back(k);
  }
  std::string digests;
  for (const int file : files) {
    const DicomHeader& first = stack.slices[slices_of_file[file].front()];
    TF_ASSIGN_OR_RETURN(const std::string contents, ReadWholeFile(first.path, &max_bytes));
    absl::StrAppend(&digests, Sha256Hex({contents}));
    TF_ASSIGN_OR_RETURN(const std::vector<float> values, DecodeDicomPixels(first, contents));
    const size_t image = static_cast<size_t>(first.rows) * static_cast<size_t>(first.columns);
    for (const size_t k : slices_of_file[file]) {
      const auto frame = static_cast<size_t>(stack.slices[k].frame);
      TakeSlice(stack.slices[k], values.data() + frame * image, k, offset, volume);
    }
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
      "HU of a body in air; remove \"hu_offset\" from the recipe");
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
        ") that does not result in HU: \"hu_offset\" of the recipe is added"));
  }
  TF_RETURN_IF_ERROR(ReadSlices(stack, options.hu_offset.value_or(0), max_bytes, &volume));
  TF_RETURN_IF_ERROR(SettleValues(options, StatesRescale(stack), &volume));
  return volume;
}

}  // namespace tissueform
