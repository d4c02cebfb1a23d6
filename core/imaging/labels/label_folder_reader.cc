// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/label_folder_reader.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include <Eigen/LU>

#include "core/base/status_macros.h"
#include "core/imaging/ct/volume_file_reader.h"
#include "core/imaging/labels/segment_names.h"
#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr double kSameGridMm = 1e-2;  // at the far corner, by rounding

struct MaskFile {
  std::string path;
  std::string name;  // of the structure, as the file's name has it
  VolumeFormat format = VolumeFormat::kNifti;
  int number = 0;  // in the order of names, from 1
};

std::string NameOf(const fs::path& path) {
  const std::string stem = path.stem().string();
  return absl::EndsWithIgnoreCase(stem, ".nii") ? stem.substr(0, stem.size() - 4) : stem;
}

// By name.
absl::StatusOr<std::vector<MaskFile>> MasksIn(const std::string& folder) {
  std::vector<MaskFile> masks;
  std::error_code error;  // exceptions of the file system hold paths
  fs::directory_iterator entry(folder, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    const std::optional<VolumeFormat> format = VolumeFormatOfPath(entry->path().string());
    if (!format || !entry->is_regular_file(unknown)) continue;
    masks.push_back({entry->path().string(), NameOf(entry->path()), *format});
  }
  if (error) return absl::InvalidArgumentError("the folder cannot be read; check its permissions");
  if (masks.empty()) {
    return absl::InvalidArgumentError(
        "the folder has no .nii, .nii.gz, .nrrd, .nhdr, .mha or .mhd file; name the folder with "
        "one "
        "mask a structure, or the file of the label map");
  }
  std::ranges::sort(masks, {},
                    [](const MaskFile& mask) { return std::pair(mask.name, mask.path); });
  for (size_t m = 0; m < masks.size(); ++m) masks[m].number = static_cast<int>(m) + 1;
  return masks;
}

absl::Status CheckOptions(const LabelReadOptions& options) {
  const bool has_values = std::ranges::any_of(
      options.names, [](const LabelRule& rule) { return rule.value.has_value(); });
  if (!has_values && options.convention.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("masks of a folder have names and not numbers, but the recipe's \"labels\" has ",
                   has_values ? "numbers at \"names\"" : "a \"convention\"",
                   "; give the names of files without their endings at \"labels/names\""));
}

absl::Status CheckNames(const std::vector<MaskFile>& masks) {
  const auto twice = std::ranges::adjacent_find(masks, {}, &MaskFile::name);
  if (twice == masks.end()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "the folder has two files for \"", PrintableName(twice->name), "\"; keep one of them"));
}

LabelSegment SegmentOf(const MaskFile& mask) {
  LabelSegment segment;
  segment.name = PrintableName(mask.name);
  segment.value = mask.number;
  return segment;
}

std::string NamesOfAll(const std::vector<LabelSegment>& segments) {
  std::vector<const LabelSegment*> all(segments.size());
  std::ranges::transform(segments, all.begin(), [](const LabelSegment& s) { return &s; });
  return NamesOf(all);
}

// What is named and not used, as one sentence; nothing without any.
void NoteUnused(const char* what, const std::vector<LabelSegment>& segments,
                std::vector<std::string>* notes) {
  if (!segments.empty()) notes->push_back(absl::StrCat(what, NamesOfAll(segments), "."));
}

class FolderReader {
 public:
  explicit FolderReader(const LabelReadOptions& options)
      : options_(options), bytes_left_(options.limits.max_file_bytes) {}

  absl::StatusOr<LabelMap> Read(const std::vector<MaskFile>& masks) {
    for (const MaskFile& mask : masks) {
      if (!IsKnownName(options_, mask.name)) {
        unknown_.push_back(SegmentOf(mask));
        continue;
      }
      if (const absl::Status status = ReadMask(mask); !status.ok()) {
        return absl::Status(status.code(), absl::StrCat("mask \"", PrintableName(mask.name),
                                                        "\": ", status.message()));
      }
    }
    TF_RETURN_IF_ERROR(CheckAny());
    TF_RETURN_IF_ERROR(Assign());
    return std::move(map_);
  }

 private:
  absl::Status ReadMask(const MaskFile& mask) {
    std::error_code error;
    const auto bytes = static_cast<int64_t>(fs::file_size(mask.path, error));
    const VolumeFileRules rules = {.max_components = 1,
                                   .least_voxels = 1,
                                   .axes = options_.axes,
                                   .spare_axes = true,
                                   .max_file_bytes = bytes_left_,
                                   .max_voxels = options_.limits.max_voxels};
    bytes_left_ -= error ? 0 : bytes;
    return ReadVolumeFileValues(mask.path, mask.format, rules, [&](const VolumeFileValues& file) {
      digests_.append(absl::StrCat(mask.name, "\n", file.placed.provenance.sha256, "\n"));
      return Take(mask, file);
    });
  }

  absl::Status Take(const MaskFile& mask, const VolumeFileValues& file) {
    TF_RETURN_IF_ERROR(TakeGrid(file.placed));
    LabelSegment segment = SegmentOf(mask);
    std::vector<bool> inside(file.values.size());
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    float label = 0;
    for (size_t i = 0; i < file.values.size(); ++i) {
      const float value = file.values[i];
      if (value == 0) continue;
      if (label == 0) label = value;
      if (value != label || !(value > 0) || value != std::floor(value)) return NotAMask();
      inside[i] = true;
      ++segment.voxels;
      sum += IndexOf(i);
    }
    if (segment.voxels == 0) {
      empty_.push_back(std::move(segment));
      return absl::OkStatus();
    }
    segment.middle_mm =
        map_.origin_mm + map_.steps_mm * (sum / static_cast<double>(segment.voxels));
    map_.segments.push_back(std::move(segment));
    facts_.push_back({mask.name, {}});
    inside_.push_back(std::move(inside));
    return absl::OkStatus();
  }

  static absl::Status NotAMask() {
    return absl::InvalidArgumentError(
        "it has more than one value besides 0, or fractions: a file of a folder is the mask of one "
        "structure; name a file with several labels alone");
  }

  Eigen::Vector3d IndexOf(size_t i) const {
    const auto columns = static_cast<size_t>(map_.size[0]);
    const auto rows = static_cast<size_t>(map_.size[1]);
    const size_t slice = i / (columns * rows);
    return {static_cast<double>(i % columns), static_cast<double>(i / columns % rows),
            static_cast<double>(slice)};
  }

  // All masks have the grid of the first.
  absl::Status TakeGrid(const CtVolume& placed) {
    if (map_.format.empty()) {
      map_.size = placed.size;
      map_.origin_mm = placed.origin_mm;
      map_.steps_mm = placed.StepsMm();
      map_.format = absl::StrCat(placed.provenance.format, ", a file a structure");
      map_.notes = placed.provenance.notes;
      return absl::OkStatus();
    }
    const Eigen::Vector3d far(map_.size[0], map_.size[1], map_.size[2]);
    const Eigen::Vector3d ours = map_.origin_mm + map_.steps_mm * far;
    const Eigen::Vector3d theirs = placed.origin_mm + placed.StepsMm() * far;
    const bool is_same = map_.size == placed.size &&
                         (map_.origin_mm - placed.origin_mm).norm() < kSameGridMm &&
                         (map_.steps_mm - placed.StepsMm()).norm() < kSameGridMm &&
                         (ours - theirs).norm() < kSameGridMm;
    if (is_same) return absl::OkStatus();
    return absl::InvalidArgumentError(
        "its grid is not that of the masks before it; export all masks on the grid of one image");
  }

  absl::Status CheckAny() const {
    if (!map_.format.empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        "none of its ", unknown_.size(),
        " files has the name of a known structure: ", NamesOfAll(unknown_),
        "; state what they are at \"labels/names\" in the recipe (", StructureKeys(), ")"));
  }

  absl::Status Assign() {
    map_.sha256 = Sha256Hex({digests_});
    NoteUnused("Files of the label map's folder that are not known and not read: ", unknown_,
               &map_.notes);
    NoteUnused("Masks of the label map's folder without a voxel: ", empty_, &map_.notes);
    LabelReadOptions options = options_;
    std::erase_if(options.names, [&](const LabelRule& rule) { return IsEmptyMask(rule.name); });
    TF_RETURN_IF_ERROR(AssignStructures(options, facts_, std::abs(map_.steps_mm.determinant()),
                                        &map_.segments, &map_.notes));
    map_.structures.assign(static_cast<size_t>(map_.num_voxels()), 0);
    for (size_t s = 0; s < map_.segments.size(); ++s) {
      const StructureSet set = SetOf(*map_.segments[s].structure);
      for (size_t i = 0; i < map_.structures.size(); ++i) {
        if (inside_[s][i]) map_.structures[i] |= set;
      }
    }
    return absl::OkStatus();
  }

  bool IsEmptyMask(const std::string& name) const {
    return std::ranges::any_of(empty_, [&](const LabelSegment& segment) {
      return absl::EqualsIgnoreCase(segment.name, PrintableName(name));
    });
  }

  const LabelReadOptions& options_;
  int64_t bytes_left_;
  LabelMap map_;
  std::string digests_;
  std::vector<LabelSegment> unknown_;
  std::vector<LabelSegment> empty_;
  std::vector<SegmentFacts> facts_;        // of map_.segments
  std::vector<std::vector<bool>> inside_;  // of map_.segments, by voxel
};

}  // namespace

absl::StatusOr<LabelMap> ReadLabelFolder(const std::string& path, const LabelReadOptions& options) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_ASSIGN_OR_RETURN(const std::vector<MaskFile> masks, MasksIn(path));
  TF_RETURN_IF_ERROR(CheckNames(masks));
  return FolderReader(options).Read(masks);
}

}  // namespace tissueform
