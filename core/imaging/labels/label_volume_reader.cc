// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/label_volume_reader.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <Eigen/LU>

#include "core/base/status_macros.h"
#include "core/imaging/ct/file_bytes.h"
#include "core/imaging/ct/nifti_header.h"
#include "core/imaging/ct/volume_file_reader.h"
#include "core/imaging/labels/label_facts.h"
#include "core/imaging/labels/segment_names.h"

namespace tissueform {
namespace {

constexpr int kMaxValue = 65535;
constexpr size_t kMaxTableBytes = size_t{1} << 20;
constexpr int kMaxLayers = 1000;

// Steps through the voxels of one layer of a file, i fastest.
template <typename Visit>
void ForEachOfLayer(const VolumeFileValues& file, int layer, Visit visit) {
  const auto components = static_cast<size_t>(file.components);
  size_t at = static_cast<size_t>(layer);
  for (int k = 0; k < file.placed.size[2]; ++k) {
    for (int j = 0; j < file.placed.size[1]; ++j) {
      for (int i = 0; i < file.placed.size[0]; ++i, at += components) {
        visit(file.values[at], Eigen::Vector3i(i, j, k));
      }
    }
  }
}

absl::Status CheckValues(const VolumeFileValues& file) {
  for (size_t i = 0; i < file.values.size(); ++i) {
    const float value = file.values[i];
    if (value >= 0 && value <= kMaxValue && value == std::floor(value)) continue;
    return absl::InvalidArgumentError(
        absl::StrFormat("it has the value %g, and labels are whole numbers from 0 to %d: it is an "
                        "image or a map of "
                        "probabilities; export the label map",
                        static_cast<double>(value), kMaxValue));
  }
  return absl::OkStatus();
}

// Number and mean index of the voxels of each value of a layer.
struct Tally {
  int64_t voxels = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
};

absl::Status TallyLayer(const VolumeFileValues& file, int layer, const LabelLimits& limits,
                        std::vector<LabelSegment>* segments) {
  std::vector<Tally> tallies(kMaxValue + 1);
  ForEachOfLayer(file, layer, [&](float value, const Eigen::Vector3i& voxel) {
    if (value == 0) return;
    Tally& tally = tallies[static_cast<size_t>(value)];
    ++tally.voxels;
    tally.sum += voxel.cast<double>();
  });
  for (int value = 1; value <= kMaxValue; ++value) {
    const Tally& tally = tallies[static_cast<size_t>(value)];
    if (tally.voxels == 0) continue;
    if (segments->size() == static_cast<size_t>(limits.max_segments)) {
      return absl::ResourceExhaustedError(absl::StrCat("it has more than ", limits.max_segments,
                                                       " different labels; is it a label map?"));
    }
    const Eigen::Vector3d mean = tally.sum / static_cast<double>(tally.voxels);
    LabelSegment segment;
    segment.layer = layer;
    segment.value = value;
    segment.voxels = tally.voxels;
    segment.middle_mm = file.placed.origin_mm + file.placed.StepsMm() * mean;
    segments->push_back(std::move(segment));
  }
  return absl::OkStatus();
}

std::vector<SegmentFacts> TakeFacts(const FactsByLabel& facts,
                                    std::vector<LabelSegment>* segments) {
  std::vector<SegmentFacts> taken;
  for (LabelSegment& segment : *segments) {
    const auto found = facts.find({segment.layer, segment.value});
    taken.push_back(found == facts.end() ? SegmentFacts() : found->second);
    segment.name = PrintableName(taken.back().name);
  }
  return taken;
}

void TakeStructures(const VolumeFileValues& file, LabelMap* map) {
  map->structures.assign(static_cast<size_t>(map->num_voxels()), 0);
  for (int layer = 0; layer < file.components; ++layer) {
    std::vector<StructureSet> set_of_value(kMaxValue + 1, 0);
    for (const LabelSegment& segment : map->segments) {
      if (segment.layer != layer || !segment.structure) continue;
      set_of_value[static_cast<size_t>(segment.value)] = SetOf(*segment.structure);
    }
    size_t index = 0;
    ForEachOfLayer(file, layer, [&](float value, const Eigen::Vector3i&) {
      map->structures[index++] |= set_of_value[static_cast<size_t>(value)];
    });
  }
}

absl::StatusOr<LabelMap> ToLabelMap(VolumeFileValues file, const FactsByLabel& facts,
                                    const LabelReadOptions& options) {
  TF_RETURN_IF_ERROR(CheckValues(file));
  LabelMap map;
  map.size = file.placed.size;
  map.origin_mm = file.placed.origin_mm;
  map.steps_mm = file.placed.StepsMm();
  map.format = file.placed.provenance.format;
  map.sha256 = file.placed.provenance.sha256;
  map.notes = std::move(file.placed.provenance.notes);
  for (int layer = 0; layer < file.components; ++layer) {
    TF_RETURN_IF_ERROR(TallyLayer(file, layer, options.limits, &map.segments));
  }
  const std::vector<SegmentFacts> facts_of_segment = TakeFacts(facts, &map.segments);
  TF_RETURN_IF_ERROR(AssignStructures(
      options, facts_of_segment, std::abs(map.steps_mm.determinant()), &map.segments, &map.notes));
  TakeStructures(file, &map);
  return map;
}

absl::StatusOr<FactsByLabel> ReadNiftiTable(const std::string& path, int64_t max_bytes) {
  TF_ASSIGN_OR_RETURN(const std::string contents, ReadWholeFile(path, &max_bytes));
  const std::string start = UnpackedStart(contents, kMaxTableBytes);
  const std::optional<NiftiHeader> header = ParseNiftiHeader(start);
  if (!header || !(header->voxel_offset > 0)) return FactsByLabel();
  const double end = std::min(header->voxel_offset, static_cast<double>(start.size()));
  return FactsOfNifti(absl::string_view(start).substr(0, static_cast<size_t>(end)));
}

}  // namespace

absl::StatusOr<LabelMap> ReadLabelVolume(const std::string& path, VolumeFormat format,
                                         const LabelReadOptions& options) {
  FactsByLabel facts;
  if (format == VolumeFormat::kNifti) {
    TF_ASSIGN_OR_RETURN(facts, ReadNiftiTable(path, options.limits.max_file_bytes));
  }
  absl::StatusOr<LabelMap> map = absl::InternalError("not read");
  TF_RETURN_IF_ERROR(ReadVolumeFileValues(path, format,
                                          {.max_components = kMaxLayers,
                                           .least_voxels = 1,
                                           .axes = options.axes,
                                           .spare_axes = true,
                                           .max_file_bytes = options.limits.max_file_bytes,
                                           .max_voxels = options.limits.max_voxels},
                                          [&](VolumeFileValues file) {
                                            if (format == VolumeFormat::kNrrd)
                                              facts = FactsOfNrrd(file.texts);
                                            map = ToLabelMap(std::move(file), facts, options);
                                            return map.status();
                                          }));
  return map;
}

}  // namespace tissueform
