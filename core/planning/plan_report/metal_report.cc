// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/metal_report.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"

#include "core/planning/json_values.h"
#include "core/planning/plan_report/slice_pictures.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMaxSlices = 3;
constexpr double kSlicesApartMm = 3;
// A filling of 200 mm3 is a small crown's; from a few of them on rays are left through no
// direction.
constexpr double kMuchMetalMm3 = 2500;

// Heights of the middles of the largest pieces.
std::vector<double> HeightsToShow(const MetalReport& metal) {
  std::vector<double> heights;
  for (const MetalCluster& cluster : metal.clusters) {
    const double z = cluster.centre_mm.z();
    const bool beside = std::any_of(heights.begin(), heights.end(), [z](double other) {
      return std::abs(other - z) < kSlicesApartMm;
    });
    if (!beside) heights.push_back(z);
    if (heights.size() == kMaxSlices) break;
  }
  return heights;
}

}  // namespace

Json MetalJson(const PlanBuild& build) {
  const MetalReport& metal = build.metal;
  const bool of_ct = build.surface_roles.empty();
  Json json = {{"looked_for", of_ct && build.recipe.metal.correct}, {"found", metal.any()}};
  if (!metal.any()) return json;
  json["volume_mm3"] = metal.volume_mm3;
  json["threshold_hu"] = metal.threshold_hu;
  json["low_z_mm"] = metal.low_z_mm;
  json["high_z_mm"] = metal.high_z_mm;
  json["corrected_slices"] = metal.corrected_slices;
  json["skin_carried_over"] = {{"slices", metal.carried.slices},
                               {"filled_mm3", metal.carried.filled_mm3},
                               {"removed_mm3", metal.carried.removed_mm3}};
  json["streaks_removed_mm3"] = build.head.streaks_mm3;
  json["streaks_removed_means"] =
      "still as dense as bone after the correction, but as thin as a streak: soft tissue";
  json["pieces"] = Json::array();
  for (const MetalCluster& cluster : metal.clusters) {
    json["pieces"].push_back({{"volume_mm3", cluster.volume_mm3},
                              {"centre_mm", ToJson(cluster.centre_mm)},
                              {"low_z_mm", cluster.low_z_mm},
                              {"high_z_mm", cluster.high_z_mm},
                              {"top_hu", cluster.top_hu}});
  }
  return json;
}

std::vector<std::string> MetalCautions(const PlanBuild& build) {
  const MetalReport& metal = build.metal;
  if (!metal.any()) return {};
  std::vector<std::string> cautions = {absl::StrFormat(
      "There is metal in the mouth: %d piece%s of %.1f cm3 together, from z = %.1f to %.1f mm. Its "
      "artifacts were reduced in %d slices (picture: before and after). Within about 5 mm of it "
      "the "
      "edges of teeth, bone, lips and cheeks are uncertain, and so are the teeth's landmarks: "
      "check "
      "them, and set \"occlusal_plane\" and the segments' planes in the recipe where they are "
      "wrong.",
      static_cast<int>(metal.clusters.size()), metal.clusters.size() == 1 ? "" : "s",
      metal.volume_mm3 / 1000, metal.low_z_mm, metal.high_z_mm, metal.corrected_slices)};
  if (metal.carried.slices > 0) {
    cautions.push_back(absl::StrFormat(
        "Streaks tear the skin in %d slices. Its course there was carried over from the slices "
        "below "
        "and above: %.1f cm3 became soft tissue, %.1f cm3 outside became air. The shape of the "
        "skin "
        "is uncertain there (colored in the picture of the metal).",
        metal.carried.slices, metal.carried.filled_mm3 / 1000, metal.carried.removed_mm3 / 1000));
  }
  if (metal.volume_mm3 > kMuchMetalMm3) {
    cautions.push_back(absl::StrFormat(
        "This much metal (%.1f cm3) hides most of the teeth: automatic planes and landmarks "
        "from them may be wrong by several mm. Set \"occlusal_plane\" and the planes of the "
        "segments in the recipe.",
        metal.volume_mm3 / 1000));
  }
  return cautions;
}

MetalSlices DrawMetalSlices(const PlanBuild& build) {
  MetalSlices slices;
  const GridGeometry& over = build.head.hu.geometry;
  for (const double z : HeightsToShow(build.metal)) {
    const Eigen::Vector3d through(over.origin_mm.x(), over.origin_mm.y(), z);
    const std::string at = absl::StrFormat("z = %.1f mm, ", z);
    slices.before.push_back(
        DrawPlainSlice(build.before_correction, over, AxialSlice(at + "original", through)));
    slices.after.push_back(DrawCarriedSkin(build, AxialSlice(at + "artifacts reduced", through)));
  }
  return slices;
}

}  // namespace tissueform
