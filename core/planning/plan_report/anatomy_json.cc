// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/anatomy_json.h"

#include <string>
#include <utility>
#include <vector>

#include "core/planning/json_values.h"
#include "core/planning/plan_report/coverage_report.h"
#include "core/planning/plan_report/objects_report.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

Json PlaneJson(const Plane& plane) {
  return {{"point_mm", ToJson(plane.point_mm)}, {"normal", ToJson(plane.normal)}};
}

Json PlanesJson(const std::vector<Plane>& planes) {
  Json list = Json::array();
  for (const Plane& plane : planes) list.push_back(PlaneJson(plane));
  return list;
}

const char* SeparationText(JawSeparation separation) {
  switch (separation) {
    case JawSeparation::kThreshold:
      return "the teeth do not touch: at marker_hu the mandible is a separate component";
    case JawSeparation::kAutomaticCut:
      return "the teeth touch: separated by the plane between them with the best clearance";
    case JawSeparation::kGiven:
      return "skull and lower jaw were given apart";
    case JawSeparation::kLabels:
      return "by the label map";
    case JawSeparation::kGivenCut:
      break;
  }
  return "separated by the recipe's occlusal_plane";
}

}  // namespace

Json HeadJson(const PlanBuild& build) {
  const GridGeometry& grid = build.head.hu.geometry;
  return {{"spacing_mm", grid.spacing_mm},
          {"size_voxels", grid.size},
          {"origin_mm", ToJson(grid.origin_mm)},
          {"volume_mm3", static_cast<double>(CountVoxels(build.head.head)) * VoxelVolumeMm3(grid)},
          {"removed_mm3", build.head.removed_mm3},
          {"removed_means", "removed objects: tubes, cords, head rest"},
          {"removed_objects", ObjectsJson(build)},
          {"bare_fraction", build.head.bare_fraction},
          {"bare_means",
           "share of the outer surface within 2.5 mm of bone; a living head has 0 to 0.1"}};
}

Json BoneJson(const PlanBuild& build, const PlanMeasures& measures) {
  Json bone = {{"cranium_mm3", measures.bone_mm3[kCranium]},
               {"mandible_mm3", measures.bone_mm3[kMandible]},
               {"spine_mm3", measures.bone_mm3[kSpine]},
               {"separation", SeparationText(build.parts.separation)},
               {"marker_hu", build.parts.marker_hu}};
  if (build.parts.occlusal_plane) {
    bone["occlusal_plane"] = PlaneJson(*build.parts.occlusal_plane);
    bone["occlusal_clearance"] = build.parts.occlusal_clearance;
  }
  if (build.parts.separation == JawSeparation::kGiven) return bone;
  bone["confidence"] = build.parts.confidence;
  bone["confidence_means"] =
      "share of the mandible's surface that is visible in the CT, bone next to other material; "
      "where the "
      "rest touches the cranium the watershed or the plane decides, and the surface within 3 mm of "
      "metal "
      "is not visible";
  return bone;
}

Json LandmarksJson(const PlanBuild& build) {
  const Landmarks& landmarks = build.landmarks;
  Json json = {{"unit", "mm, LPS"}};
  for (const auto& [name, point] :
       {std::pair("menton", landmarks.menton),
        std::pair("pogonion", landmarks.pogonion),
        std::pair("lower_incisor", landmarks.lower_incisor),
        std::pair("upper_incisor", landmarks.upper_incisor),
        std::pair("lower_molar_left", landmarks.lower_molar.left),
        std::pair("lower_molar_right", landmarks.lower_molar.right),
        std::pair("upper_molar_left", landmarks.upper_molar.left),
        std::pair("upper_molar_right", landmarks.upper_molar.right),
        std::pair("last_upper_tooth_left", landmarks.last_upper_tooth.left),
        std::pair("last_upper_tooth_right", landmarks.last_upper_tooth.right),
        std::pair("ramus_front_left", landmarks.ramus_front.left),
        std::pair("ramus_front_right", landmarks.ramus_front.right),
        std::pair("gonion_left", landmarks.gonion.left),
        std::pair("gonion_right", landmarks.gonion.right),
        std::pair("condyle_left", landmarks.condyle.left),
        std::pair("condyle_right", landmarks.condyle.right),
        std::pair("nasal_floor", landmarks.nasal_floor),
        std::pair("nose_tip", landmarks.nose_tip),
        std::pair("subnasale", landmarks.subnasale),
        std::pair("upper_lip", landmarks.upper_lip),
        std::pair("lower_lip", landmarks.lower_lip),
        std::pair("skin_pogonion", landmarks.skin_pogonion),
        std::pair("mouth_corner_left", landmarks.mouth_corner.left),
        std::pair("mouth_corner_right", landmarks.mouth_corner.right)}) {
    json[name] = ToJson(point);
  }
  json["nose_prominence_mm"] =
      NoseIsCut(build.coverage) ? Json(nullptr) : Json(landmarks.nose_prominence_mm);
  for (const auto& [name, plane] : {std::pair("midsagittal_plane", landmarks.midsagittal),
                                    std::pair("lower_teeth_plane", landmarks.lower_teeth),
                                    std::pair("upper_teeth_plane", landmarks.upper_teeth),
                                    std::pair("occlusal_plane", landmarks.occlusal)}) {
    json[name] = PlaneJson(plane);
  }
  for (const char* name : {"porion_left", "porion_right", "orbitale_left", "orbitale_right"}) {
    json[name] = nullptr;
  }
  if (build.frankfort) {
    json["porion_left"] = ToJson(build.frankfort->porion.left);
    json["porion_right"] = ToJson(build.frankfort->porion.right);
    json["orbitale_left"] = ToJson(build.frankfort->orbitale.left);
    json["orbitale_right"] = ToJson(build.frankfort->orbitale.right);
  }
  const HeadFrame& frame = build.head_frame;
  json["head_frame"] = {{"origin_mm", ToJson(frame.origin_mm)},
                        {"left", ToJson(frame.left)},
                        {"posterior", ToJson(frame.posterior)},
                        {"superior", ToJson(frame.superior)},
                        {"source", frame.source}};
  return json;
}

Json SegmentsJson(const PlanBuild& build) {
  Json segments = Json::array();
  for (size_t s = 0; s < build.segments.size(); ++s) {
    const BuiltSegment& segment = build.segments[s];
    const bool given = !build.recipe.segments[s].planes.empty();
    const bool cut = !segment.cut.planes.empty();
    segments.push_back({{"name", segment.cut.name},
                        {"osteotomy", std::string(OsteotomyKindName(segment.cut.kind))},
                        {"volume_mm3", segment.volume_mm3},
                        {"pose", ToJson(segment.pose)},
                        {"largest_move_mm", segment.largest_move_mm},
                        {"planes_from", given ? "recipe"
                                        : cut ? "anatomy"
                                              : "surface"},
                        {"planes", PlanesJson(segment.cut.planes)}});
  }
  return segments;
}

Json RegionJson(const PlanBuild& build) {
  const RegionOfInterest& region = build.soft_tissue.region;
  Json json = {{"back", PlaneJson(region.back)},
               {"above", PlaneJson(region.above)},
               {"below", PlaneJson(region.below)}};
  json["back"]["from"] = build.recipe.back ? "recipe" : "anatomy";
  json["above"]["from"] = build.recipe.above ? "recipe" : "anatomy";
  json["below"]["from"] = build.recipe.below ? "recipe" : "anatomy";
  return json;
}

Json SoftTissueJson(const SoftTissue& soft_tissue) {
  return {{"volume_mm3", soft_tissue.volume_mm3},
          {"left_out_mm3", soft_tissue.left_out_mm3},
          {"left_out_means",
           "soft voxels in the region's box that are not modeled: brain, marrow, thin sheets"},
          {"filled_mm3", soft_tissue.filled_mm3},
          {"filled_means",
           "modeled although not a soft voxel: air or bone behind thin skin, small cavities"}};
}

}  // namespace tissueform
