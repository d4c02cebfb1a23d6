// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/labels_report.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

// Labels that are a voxel too large or too small have 0.7 to 0.8 on coarse voxels.
constexpr double kLowDice = 0.7;
constexpr double kLowBoneInLabels = 0.5;

const char* SideText(Side side) {
  switch (side) {
    case Side::kLeft:
      return "left";
    case Side::kRight:
      return "right";
    case Side::kNone:
      break;
  }
  return "";
}

// Segments that are not known are only counted: their names are not ours to pass on.
Json SegmentsJson(const PlanLabels& labels) {
  Json list = Json::array();
  for (const LabelSegment& segment : labels.segments) {
    if (!segment.structure) continue;
    list.push_back({{"value", segment.value},
                    {"layer", segment.layer},
                    {"structure", std::string(StructureKey(*segment.structure))},
                    {"side", SideText(segment.side)},
                    {"voxels", segment.voxels}});
  }
  return list;
}

Json AgreementJson(const LabelAgreement& agreement) {
  Json list = Json::array();
  for (const StructureAgreement& structure : agreement.structures) {
    list.push_back({{"structure", structure.name},
                    {"labelled_mm3", structure.labelled_mm3},
                    {"own_mm3", structure.own_mm3},
                    {"dice", structure.dice}});
  }
  return list;
}

}  // namespace

Json LabelsJson(const std::optional<PlanLabels>& labels) {
  if (!labels) return nullptr;
  const LabelAgreement& agreement = labels->agreement;
  return {{"format", labels->format},
          {"sha256", labels->sha256},
          {"segments", SegmentsJson(*labels)},
          {"agreement", AgreementJson(agreement)},
          {"agreement_means", "of the label map and of our own segmentation of the same CT"},
          {"labels_on_bone", labels->fit.on_bone},
          {"labels_on_bone_left", labels->fit.on_bone_left},
          {"labels_on_bone_right", labels->fit.on_bone_right},
          {"bone_in_labels", agreement.bone_in_labels},
          {"only_labels_mm3", agreement.only_labels_mm3},
          {"only_image_mm3", agreement.only_image_mm3},
          {"other_jaw_mm3", agreement.other_bone_mm3},
          {"cleared_hollow_mm3", labels->cleared.hollow_mm3},
          {"cleared_outside_mm3", labels->cleared.outside_mm3},
          {"notes", labels->notes}};
}

std::string LabelsText(const PlanLabels& labels) {
  std::string text;
  for (const StructureAgreement& structure : labels.agreement.structures) {
    absl::StrAppendFormat(&text, "labels  %s: Dice %.3f (labels %.1f cm3, CT %.1f cm3)\n",
                          structure.name, structure.dice, structure.labelled_mm3 / 1000,
                          structure.own_mm3 / 1000);
  }
  if (labels.fit.has_bone) {
    absl::StrAppendFormat(&text,
                          "labels  %.0f %% of the labelled bone on the CT's bone (left %.0f %%, "
                          "right %.0f %%), %.0f %% of the jaws' bone labelled\n",
                          100 * labels.fit.on_bone, 100 * labels.fit.on_bone_left,
                          100 * labels.fit.on_bone_right, 100 * labels.agreement.bone_in_labels);
  }
  for (const std::string& note : labels.notes) absl::StrAppend(&text, "labels  ", note, "\n");
  return text;
}

std::vector<std::string> LabelsCautions(const std::optional<PlanLabels>& labels) {
  std::vector<std::string> cautions;
  if (!labels) return cautions;
  std::string disagreements;
  for (const StructureAgreement& structure : labels->agreement.structures) {
    if (structure.dice >= kLowDice) continue;
    absl::StrAppendFormat(&disagreements, "%s the %s (Dice %.2f)", disagreements.empty() ? "" : ",",
                          structure.name, structure.dice);
  }
  if (!disagreements.empty()) {
    cautions.push_back(absl::StrCat("The label map and the CT disagree on", disagreements,
                                    ": check the picture of the labels."));
  }
  if (labels->fit.has_bone && labels->agreement.bone_in_labels < kLowBoneInLabels) {
    cautions.push_back(absl::StrFormat(
        "Only %.0f %% of the jaws' bone in this CT is labelled; the rest was found by thresholds.",
        100 * labels->agreement.bone_in_labels));
  }
  return cautions;
}

}  // namespace tissueform
