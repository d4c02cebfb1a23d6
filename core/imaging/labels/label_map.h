// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/imaging/labels/structures.h"

namespace tissueform {

// Limits on label maps, which come from outside (docs/ct-input.md).
struct LabelLimits {
  int64_t max_file_bytes = int64_t{1} << 30;
  int64_t max_voxels = int64_t{1} << 28;  // of all layers together
  int max_segments = 10000;
  int64_t max_memory_bytes = int64_t{8} << 30;  // of the process that reads
  int max_seconds = 300;                        // of its processor time
};

// One entry of "labels/names" of a recipe: a segment of that name or value is that structure.
struct LabelRule {
  Structure structure = Structure::kLowerJaw;
  std::string name;          // empty: by value
  std::optional<int> value;  // in a DICOM SEG the number of the segment
};

// What the file cannot state.
struct LabelReadOptions {
  std::vector<LabelRule> names;

  // "dentalsegmentator", "totalsegmentator" or "totalsegmentator_6": what numbers without names
  // mean. Empty: the only one of them that fits, otherwise an error.
  std::string convention;

  // As CtReadOptions::axes, for a file that does not state how it lies in the patient.
  std::string axes;

  LabelLimits limits;
};

// A segment of the file, as far as it is used.
struct LabelSegment {
  std::string name;  // printable ASCII, at most 40 characters; empty where the file has none
  int layer = 0;     // of the file, where segments overlap
  int value = 0;
  std::optional<Structure> structure;  // nothing: not known, and ignored
  Side side = Side::kNone;
  int64_t voxels = 0;
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();  // mean place of its voxels, LPS
};

// A label map as it was read: on its own grid, LPS, mm. p = origin_mm + steps_mm * (i, j, k).
struct LabelMap {
  std::array<int, 3> size = {0, 0, 0};
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d steps_mm = Eigen::Matrix3d::Identity();  // columns: from one voxel to the next
  std::vector<StructureSet> structures;                    // i fastest

  std::string format;  // "NRRD", "NIfTI", "MetaImage", "DICOM SEG"; "..., a file a structure"
  std::string sha256;  // of the file; of a header with data files as CtProvenance::sha256; of a
                       // folder that of names and digests of the masks that were read
  std::vector<LabelSegment> segments;
  std::vector<std::string> notes;  // what a reader of the report should know, one sentence each

  // The frame of reference of a DICOM SEG, to compare with the CT's; never in a message or report.
  std::string frame_uid;

  int64_t num_voxels() const { return int64_t{size[0]} * size[1] * size[2]; }
};

// Reads a label map: NRRD and .seg.nrrd, NIfTI, MetaImage, a file of DICOM SEG (binary, fractional,
// label map), or a folder of masks (label_folder_reader.h). What a segment is follows from, in this
// order: `names`, its name in the file, its code, `convention` or the convention that its number
// fits. Runs in a helper program within the limits. Any thread may call it.
//
// Errors: NotFound when there is no such file; ResourceExhausted beyond a limit; InvalidArgument
// for what is not a label map: values that are not whole numbers from 0 to 65535, no labelled
// voxel, no known segment, left and right swapped by name. One line each, without the path.
absl::StatusOr<LabelMap> ReadLabelMap(const std::string& path,
                                      const LabelReadOptions& options = {});

}  // namespace tissueform
