// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/plan_labels.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::Status CheckFrame(const LabelMap& map, const std::string& frame_uid) {
  if (map.frame_uid.empty() || frame_uid.empty() || map.frame_uid == frame_uid) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "the DICOM SEG belongs to another image: its frame of reference is not the CT's; name the "
      "CT "
      "that it was made on with --ct");
}

absl::Status CheckOverlap(const LabelledGrid& labels) {
  const std::vector<StructureSet>& sets = labels.structures.values;
  if (std::ranges::any_of(sets, [](StructureSet set) { return set != 0; })) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "the label map does not overlap the CT: no labelled voxel lies in the CT's volume; is it of "
      "this CT, and in its frame (LPS, mm)?");
}

absl::Status WithSubject(const absl::Status& status) {
  if (status.ok()) return status;
  return {status.code(), absl::StrCat("cannot use the label map: ", status.message())};
}

// Where the image alone does not separate the jaws.
BoneParts AllCranium(const HeadSegmentation& head) {
  BoneParts parts;
  parts.labels = MaskWhere(head.bone, [](uint8_t bone) { return bone != 0; });
  return parts;
}

// Writes 1 + place of the tissue where the structure is labelled.
void TakeTissue(Structure structure, const StiffnessTable& table, PlanLabels* labels) {
  const VoxelGrid<StructureSet>& sets = labels->grid.structures;
  const LabelGrid labelled =
      MaskWhere(sets, [structure](StructureSet set) { return (set & SetOf(structure)) != 0; });
  if (CountVoxels(labelled) == 0) return;
  const auto tissue = std::ranges::find(table, StructureKey(structure), &TissueClass::name);
  if (tissue == table.end()) {
    labels->notes.push_back(
        absl::StrCat("The label map has ", StructureKey(structure),
                     ", and the recipe no tissue of that name: the CT decides."));
    return;
  }
  if (labels->tissue.values.empty()) labels->tissue = LabelGrid(sets.geometry);
  for (size_t i = 0; i < labelled.values.size(); ++i) {
    if (labelled.values[i] == 0) continue;
    labels->tissue.values[i] = static_cast<uint8_t>(1 + (tissue - table.begin()));
  }
}

}  // namespace

absl::StatusOr<std::optional<PlanLabels>> ReadPlanLabels(const Recipe& recipe,
                                                         const std::string& frame_uid, int threads,
                                                         HuGrid* ct) {
  if (recipe.labels.file.empty()) return std::nullopt;
  LabelReadOptions options;
  options.names = recipe.labels.names;
  options.convention = recipe.labels.convention;
  options.axes = recipe.ct.axes;
  TF_ASSIGN_OR_RETURN(LabelMap map, ReadLabelMap(recipe.labels.file, options));
  TF_RETURN_IF_ERROR(WithSubject(CheckFrame(map, frame_uid)));
  PlanLabels labels;
  labels.grid = ResampleLabels(map, ct->geometry, threads);
  labels.format = std::move(map.format);
  labels.sha256 = std::move(map.sha256);
  labels.segments = std::move(map.segments);
  labels.notes = std::move(map.notes);
  TF_RETURN_IF_ERROR(WithSubject(CheckOverlap(labels.grid)));
  labels.fit = MeasureLabelFit(labels.grid, *ct, recipe.segmentation.bone_above_hu);
  TF_RETURN_IF_ERROR(WithSubject(CheckLabelFit(labels.fit)));
  labels.cleared = ClearByLabels(labels.grid, recipe.segmentation, ct);
  if (labels.cleared.head_is_open) {
    labels.notes.emplace_back(
        "The labelled head or skin is open, and is not used: the skin is found in the CT.");
  }
  return labels;
}

absl::StatusOr<BoneParts> SeparateByLabels(absl::StatusOr<BoneParts> parts,
                                           const StiffnessTable& table, HeadSegmentation* head,
                                           PlanLabels* labels) {
  labels->grid = CropLabels(labels->grid, head->hu.geometry);
  const bool separated = parts.ok();
  if (!separated && !HasBothJaws(labels->grid)) return parts;
  BoneParts result = separated ? *std::move(parts) : AllCranium(*head);
  if (!separated) {
    labels->notes.emplace_back(
        "The CT alone does not show where the jaws separate; the label map decides.");
  }
  labels->agreement = CompareLabels(labels->grid, *head, result);
  ApplyLabels(labels->grid, head, &result);
  for (const Structure structure : {Structure::kMuscle, Structure::kFat}) {
    TakeTissue(structure, table, labels);
  }
  labels->grid = {};
  TF_RETURN_IF_ERROR(CheckLowerJawInView(result));
  return result;
}

}  // namespace tissueform
