// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/coverage_report.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "core/planning/json_values.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

// Bone comes to the skin where streaks of metal were taken for it, or where tissue is thinner than
// the CT shows: a sound head has next to none.
constexpr double kMuchBoneInSkin = 0.01;
// Fat has -130 to -70 HU.
constexpr double kLooserThanSkinHu = -180;

const Colour kCoveredColour = kTissueColour;
const Colour kMissingColour{0.85, 0.10, 0.10};
const Colour kGapColour{0.45, 0.00, 0.05};
const Colour kScannerCutColour{0.35, 0.45, 0.70};

// Of a region: less of it at a cut is its edge, not itself.
constexpr double kLeastCutMm2 = 10;

std::string Words(SkinRegion region) {
  switch (region) {
    case SkinRegion::kUpperLip:
      return "the upper lip";
    case SkinRegion::kLowerLip:
      return "the lower lip";
    case SkinRegion::kChin:
      return "the chin";
    case SkinRegion::kNose:
      return "the nose";
    case SkinRegion::kLeftCheek:
      return "the left cheek";
    case SkinRegion::kRightCheek:
      return "the right cheek";
    case SkinRegion::kNone:
      break;
  }
  return "the unnamed skin";
}

std::string KeyOf(SkinRegion region) {
  return region == SkinRegion::kNone ? "elsewhere" : std::string(SkinRegionName(region));
}

std::string PlaceText(const Vector3d& place) {
  return absl::StrFormat("(%.0f, %.0f, %.0f) mm", place.x(), place.y(), place.z());
}

// The region whose covered share is smallest.
size_t WorstRegion(const SkinCoverage& coverage) {
  const auto worst = std::min_element(
      coverage.regions.begin(), coverage.regions.end(),
      [](const CoveredPart& a, const CoveredPart& b) { return a.share() < b.share(); });
  return static_cast<size_t>(worst - coverage.regions.begin());
}

QualityCheck CheckParts(const std::string& name, const std::string& required,
                        const std::vector<SkinGap>& gaps, double largest_mm2) {
  if (gaps.empty()) return {name, required, "none", true};
  const SkinGap& largest = gaps.front();
  return {name, required,
          absl::StrFormat("largest %.2f cm2, in %s, up to %.1f mm", largest.area_mm2 / 100,
                          Words(largest.region), largest.largest_mm),
          largest.area_mm2 <= largest_mm2};
}

// Says so where what is missing is no skin but hair or cloth.
std::string LooseText(double hu_behind, const InputWords& words) {
  // HU of surfaces are made from distances.
  if (words.of_surfaces || hu_behind >= kLooserThanSkinHu) return "";
  return absl::StrFormat(
      " The densest material up to 3 mm behind it has %.0f HU on average, less than fat: "
      "hair or cloth rather than skin.",
      hu_behind);
}

// One line for all regions that the mesh misses too much of, with the worst; empty without any.
std::string MissingRegionsText(const SkinCoverage& coverage, const InputWords& words) {
  std::vector<size_t> missing;
  for (size_t r = 0; r < coverage.regions.size(); ++r) {
    if (coverage.regions[r].share() < kLeastCovered) missing.push_back(r);
  }
  if (missing.empty()) return "";
  std::stable_sort(missing.begin(), missing.end(), [&](size_t a, size_t b) {
    return coverage.regions[a].share() < coverage.regions[b].share();
  });
  const CoveredPart& part = coverage.regions[missing.front()];
  std::string text = absl::StrFormat(
      "The mesh misses %.1f %% of %s: %.1f of %.1f cm2 of %s are more than %.1f mm "
      "from the mesh's, up to %.1f mm at %s.",
      100 * (1 - part.share()), Words(static_cast<SkinRegion>(missing.front())),
      (part.area_mm2 - part.covered_mm2) / 100, part.area_mm2 / 100, words.the_skin,
      coverage.tolerance_mm, part.largest_mm, PlaceText(part.farthest));
  absl::StrAppend(&text, LooseText(part.hu_behind_missing, words));
  for (size_t i = 1; i < missing.size(); ++i) {
    absl::StrAppendFormat(&text, "%s %.1f %% of %s", i == 1 ? " It also misses" : ",",
                          100 * (1 - coverage.regions[missing[i]].share()),
                          Words(static_cast<SkinRegion>(missing[i])));
  }
  return missing.size() > 1 ? text + "." : text;
}

// One line for all holes that are too large, which are sorted by area, with the largest; empty
// without any.
std::string HolesText(const SkinCoverage& coverage, const InputWords& words) {
  int count = 0;
  double all_mm2 = 0;
  for (const SkinGap& hole : coverage.holes) {
    if (hole.area_mm2 <= kLargestHoleMm2) break;
    ++count;
    all_mm2 += hole.area_mm2;
  }
  if (count == 0) return "";
  const SkinGap& largest = coverage.holes.front();
  const std::string many =
      count > 1 ? absl::StrFormat("%d places, %.1f cm2 in all; the largest: ", count, all_mm2 / 100)
                : "";
  const std::string text = absl::StrFormat(
      "%s is missing in the mesh: %s%.1f cm2 of %s are more than %.1f mm from it, up "
      "to %.1f mm at %s.",
      Capitalized(words.skin_of_source), many, largest.area_mm2 / 100, Words(largest.region),
      coverage.hole_mm, largest.largest_mm, PlaceText(largest.farthest));
  return absl::StrCat(text, LooseText(largest.hu_behind, words));
}

// "the nose (1234 mm2) and the upper lip (56 mm2)"; empty where no named region is cut.
std::string CutRegionsText(const std::vector<ScannerCut>& cuts) {
  std::vector<std::string> parts;
  for (const SkinRegion region : kNamedSkinRegions) {
    double mm2 = 0;
    for (const ScannerCut& cut : cuts) {
      const double of_cut = cut.region_mm2[static_cast<size_t>(region)];
      mm2 += of_cut < kLeastCutMm2 ? 0 : of_cut;
    }
    if (mm2 == 0) continue;
    parts.push_back(absl::StrFormat("%s (%.0f mm2)", Words(region), mm2));
  }
  return absl::StrJoin(parts, ", ");
}

Json CutsJson(const std::vector<ScannerCut>& cuts) {
  Json list = Json::array();
  for (const ScannerCut& cut : cuts) {
    Json regions = Json::object();
    for (size_t r = 0; r < cut.region_mm2.size(); ++r) {
      if (cut.region_mm2[r] < kLeastCutMm2) continue;
      regions[KeyOf(static_cast<SkinRegion>(r))] = cut.region_mm2[r];
    }
    list.push_back({{"area_mm2", cut.area_mm2},
                    {"middle_mm", ToJson(cut.middle)},
                    {"low_mm", ToJson(cut.low)},
                    {"high_mm", ToJson(cut.high)},
                    {"area_mm2_by_region", std::move(regions)}});
  }
  return list;
}

Json PartJson(const CoveredPart& part) {
  return {{"area_mm2", part.area_mm2},
          {"covered_share", part.share()},
          {"largest_distance_mm", part.largest_mm},
          {"at_mm", ToJson(part.farthest)},
          {"hu_behind_missing", part.hu_behind_missing}};
}

Json GapsJson(const std::vector<SkinGap>& gaps) {
  Json list = Json::array();
  for (const SkinGap& gap : gaps) {
    list.push_back({{"region", KeyOf(gap.region)},
                    {"area_mm2", gap.area_mm2},
                    {"largest_distance_mm", gap.largest_mm},
                    {"at_mm", ToJson(gap.farthest)},
                    {"hu_behind", gap.hu_behind}});
  }
  return list;
}

double BoneShare(const SkinCoverage& coverage) {
  return coverage.mesh_skin_mm2 > 0 ? coverage.mesh_skin_on_bone_mm2 / coverage.mesh_skin_mm2 : 0;
}

}  // namespace

std::vector<QualityCheck> CheckCoverage(const SkinCoverage& coverage, const InputWords& words) {
  const size_t worst = WorstRegion(coverage);
  const double worst_share = coverage.regions[worst].share();
  const std::string within = absl::StrFormat("%s within %.1f mm of the mesh's",
                                             Capitalized(words.skin), coverage.tolerance_mm);
  return {
      {absl::StrCat(within, ", as a whole"), absl::StrFormat("at least %g %%", 100 * kLeastCovered),
       absl::StrFormat("%.2f %%", 100 * coverage.whole.share()),
       coverage.whole.share() >= kLeastCovered},
      {absl::StrCat(within, ", in each region"),
       absl::StrFormat("at least %g %%", 100 * kLeastCovered),
       absl::StrFormat("%.2f %% in %s", 100 * worst_share, Words(static_cast<SkinRegion>(worst))),
       worst_share >= kLeastCovered},
      CheckParts(absl::StrFormat("Gaps: %s farther than %g mm", words.skin, kGapMm),
                 absl::StrFormat("none over %.1f cm2", kLargestGapMm2 / 100), coverage.gaps,
                 kLargestGapMm2),
      CheckParts(absl::StrFormat("Holes: %s farther than %.1f mm", words.skin, coverage.hole_mm),
                 absl::StrFormat("none over %.1f cm2", kLargestHoleMm2 / 100), coverage.holes,
                 kLargestHoleMm2)};
}

std::vector<std::string> CoverageCautions(const SkinCoverage& coverage, const InputWords& words) {
  std::vector<std::string> cautions;
  const std::string regions = MissingRegionsText(coverage, words);
  if (!regions.empty()) cautions.push_back(regions);
  const std::string holes = HolesText(coverage, words);
  if (!holes.empty()) cautions.push_back(holes);
  if (BoneShare(coverage) > kMuchBoneInSkin) {
    cautions.push_back(
        absl::StrFormat("%.1f %% of the mesh's skin (%.1f cm2) is bone or attached to it: tissue "
                        "is missing over the "
                        "bone there, or other tissue was segmented as bone.",
                        100 * BoneShare(coverage), coverage.mesh_skin_on_bone_mm2 / 100));
  }
  return cautions;
}

std::vector<std::string> CutCautions(const SkinCoverage& coverage, const InputWords& words) {
  const std::vector<ScannerCut>& cuts = coverage.cuts;
  if (cuts.empty()) return {};
  const ScannerCut& largest = *std::max_element(
      cuts.begin(), cuts.end(),
      [](const ScannerCut& a, const ScannerCut& b) { return a.area_mm2 < b.area_mm2; });
  const double all_mm2 =
      std::accumulate(cuts.begin(), cuts.end(), 0.0,
                      [](double sum, const ScannerCut& cut) { return sum + cut.area_mm2; });
  const std::string many =
      cuts.size() > 1
          ? absl::StrFormat("%d places, %.0f mm2 in all; the largest at ", cuts.size(), all_mm2)
          : "";
  std::string text = absl::StrFormat(
      "%s cuts the face at %s%s: %.0f mm2, between %s and "
      "%s. The face extends beyond it; the model does not. The cut is not treated as skin: it is "
      "counted neither as covered nor as missing.",
      words.of_surfaces ? "An opening of the skin" : "The field of view, or a border of the CT,",
      many, PlaceText(largest.middle), largest.area_mm2, PlaceText(largest.low),
      PlaceText(largest.high));
  const std::string regions = CutRegionsText(cuts);
  if (!regions.empty()) {
    absl::StrAppend(&text, " It is in the front of the face, where predictions are evaluated: at ",
                    regions, " no skin is predicted, and its shape is not checked.");
  }
  return {text};
}

bool NoseIsCut(const SkinCoverage& coverage) {
  return std::any_of(coverage.cuts.begin(), coverage.cuts.end(), [](const ScannerCut& cut) {
    return cut.region_mm2[static_cast<size_t>(SkinRegion::kNose)] >= kLeastCutMm2;
  });
}

Json CoverageJson(const SkinCoverage& coverage, const InputWords& words) {
  Json json = {
      {"means", absl::StrCat(words.of_surfaces ? words.the_skin : "the CT's outer skin",
                             " in the region of interest, by area, against the mesh's skin")},
      {"tolerance_mm", coverage.tolerance_mm},
      {"whole", PartJson(coverage.whole)}};
  for (size_t r = 0; r < coverage.regions.size(); ++r) {
    const CoveredPart& part = coverage.regions[r];
    if (part.area_mm2 > 0) json["regions"][KeyOf(static_cast<SkinRegion>(r))] = PartJson(part);
  }
  json["gaps_beyond_4_mm"] = GapsJson(coverage.gaps);
  json["hole_mm"] = coverage.hole_mm;
  json["holes"] = GapsJson(coverage.holes);
  json[words.of_surfaces ? "cut_by_openings" : "cut_by_scanner"] = CutsJson(coverage.cuts);
  json["mesh_skin_mm2"] = coverage.mesh_skin_mm2;
  json["mesh_skin_on_bone_share"] = BoneShare(coverage);
  return json;
}

std::vector<Scene> CoverageScenes(const SkinCoverage& coverage) {
  SurfaceLayer layer{
      .positions = coverage.positions, .triangles = coverage.triangles, .edges = false};
  for (const double mm : coverage.distance_mm) {
    layer.triangle_colours.push_back(mm > std::max(kGapMm, coverage.tolerance_mm) ? kGapColour
                                     : mm > coverage.tolerance_mm                 ? kMissingColour
                                                                                  : kCoveredColour);
  }
  std::vector<SurfaceLayer> layers = {std::move(layer)};
  if (coverage.cut_triangles.rows() > 0) {
    layers.push_back({.positions = coverage.cut_positions,
                      .triangles = coverage.cut_triangles,
                      .colour = kScannerCutColour,
                      .edges = false});
  }
  std::vector<Scene> scenes;
  for (const auto& [title, from] : {std::pair("from the front", Vector3d(0, -1, 0)),
                                    std::pair("from the left, front", Vector3d(0.75, -0.75, 0.1)),
                                    std::pair("from the right, front", Vector3d(-0.75, -0.75, 0.1)),
                                    std::pair("from below", Vector3d(0, -0.7, -0.7))}) {
    scenes.push_back({.title = title, .surfaces = layers, .view = {from}});
  }
  return scenes;
}

std::vector<LegendEntry> CoverageLegend(const SkinCoverage& coverage, const InputWords& words) {
  const double gap_mm = std::max(kGapMm, coverage.tolerance_mm);
  std::vector<LegendEntry> legend = {
      {absl::StrFormat("within %.1f mm of the mesh's skin", coverage.tolerance_mm), kCoveredColour},
      {absl::StrFormat("missing: farther than %.1f mm", coverage.tolerance_mm), kMissingColour},
      {absl::StrFormat("farther than %.1f mm", gap_mm), kGapColour}};
  if (coverage.cut_triangles.rows() > 0) {
    legend.push_back(
        {words.of_surfaces ? "closed opening: not skin" : "cut by the field of view: not skin",
         kScannerCutColour});
  }
  return legend;
}

}  // namespace tissueform
