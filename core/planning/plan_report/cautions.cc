// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/cautions.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/planning/plan_report/coverage_report.h"
#include "core/planning/plan_report/input_words.h"
#include "core/planning/plan_report/labels_report.h"
#include "core/planning/plan_report/lips_report.h"
#include "core/planning/plan_report/metal_report.h"
#include "core/planning/plan_report/objects_report.h"
#include "core/planning/plan_report/values_report.h"

namespace tissueform {
namespace {

// The bundled head's nose stands 12 mm before the skin under it; one that a CT has cut off, 1.3 mm.
constexpr double kFlatNoseMm = 3;
// Below, skin follows freely where the neck would hold it.
constexpr double kLittleUnderChinMm = 15;

std::vector<std::string> MouthCautions(const PlanBuild& build) {
  if (!build.lips) {
    return LipsCautions(MeasureLipContact(build.soft_tissue.labels, build.landmarks),
                        WordsOf(build));
  }
  if (build.lips->line.line_is_sure()) return {};
  return {
      "The lips part along a line that is unsure: check the picture of the line between the lips, "
      "and give \"mouth_line_mm\" in the recipe's \"lips\" where it is wrong."};
}

// Of the head over the lowest voxel of the grid. Grids about surfaces have a margin.
double LowestMm(const PlanBuild& build) {
  const GridGeometry& grid = build.head.hu.geometry;
  double lowest_mm = grid.origin_mm.z();
  if (WordsOf(build).of_surfaces) {
    lowest_mm = INFINITY;
    ForEachVoxel(build.head.head, [&](size_t /*index*/, const Eigen::Vector3d& place) {
      lowest_mm = std::min(lowest_mm, place.z());
    });
  }
  return lowest_mm - grid.spacing_mm / 2;
}

}  // namespace

std::vector<std::string> Cautions(const PlanBuild& build) {
  const InputWords words = WordsOf(build);
  std::vector<std::string> cautions = CoverageCautions(build.coverage, words);
  for (std::string& caution : CutCautions(build.coverage, words)) {
    cautions.push_back(std::move(caution));
  }
  for (std::string& caution : ValuesCautions(build)) cautions.push_back(std::move(caution));
  for (std::string& caution : ObjectsCautions(build)) cautions.push_back(std::move(caution));
  for (std::string& caution : MetalCautions(build)) cautions.push_back(std::move(caution));
  for (std::string& caution : LabelsCautions(build.labels)) cautions.push_back(std::move(caution));
  for (std::string& caution : MouthCautions(build)) cautions.push_back(std::move(caution));
  const double nose_mm = build.landmarks.nose_prominence_mm;
  if (NoseIsCut(build.coverage)) {
    cautions.push_back(absl::StrCat(
        words.of_surfaces ? "The surfaces do" : "The CT does",
        " not contain the whole nose, so its projection is not checked. The model may have no "
        "nose tip, and the region \"nose\" may be near the upper lip and move more than a tip "
        "does."));
  } else if (nose_mm < kFlatNoseMm) {
    cautions.push_back(absl::StrFormat(
        "The nose is truncated or flattened in %s: its foremost skin is %.1f mm in front of "
        "the skin under it. The model has no nose tip, and the region \"nose\" is near "
        "the upper lip and moves more than a tip would.",
        words.this_source, nose_mm));
  }
  const double under_chin_mm = build.landmarks.menton.z() - LowestMm(build);
  if (build.parts.cut_off_mm) {
    cautions.push_back(absl::StrFormat(
        "The CT's lower border cuts the chin: about %.1f mm of its bone and the skin under it are "
        "missing. The neck, which restrains the skin there, is missing, too; the predicted "
        "movement of the chin may be too "
        "much, "
        "and its lower border is unreliable.",
        *build.parts.cut_off_mm));
  } else if (under_chin_mm < kLittleUnderChinMm) {
    cautions.push_back(absl::StrFormat(
        "%s ends %.0f mm below the bony chin: the neck, which restrains the "
        "skin there, is missing, and the predicted movement under the chin may be too large.",
        words.of_surfaces ? "The skin" : "The CT", under_chin_mm));
  }
  if (build.num_inverted > 0) {
    cautions.push_back(
        absl::StrFormat("%d tets are inverted at the planned movement, or a third beyond it, in at "
                        "least one model, and no "
                        "nearby bone contact could be released: plan a smaller movement, or use a "
                        "wider \"contact_band_mm\".",
                        build.num_inverted));
  }
  if (build.parts.separation == JawSeparation::kAutomaticCut) {
    cautions.push_back(
        "Upper and lower teeth touch in this CT and were separated by an automatic plane: check "
        "the picture of the bone, and set \"occlusal_plane\" in the recipe if it cuts teeth.");
  }
  return cautions;
}

}  // namespace tissueform
